// What one pass over the table must cost: a stream that forms the sums of products a Lambert + Phong fit needs at one
// exponent.
//
//     floor TABLE.flat EXPONENT PASSES THREADS
//
// In double and single precision, over all samples and folded: phi_d -> pi - phi_d swaps the two directions, which
// leaves cos(alpha), so each pair of samples adds up to one. The single-precision pass sums in single precision within
// a piece, in double across pieces. Prints one JSON object: seconds of each pass, and the cost ½ Σ r² of the best
// weights at that exponent, which proves the sums.
//
// Build with -O3 -march=native -ffast-math -fopenmp: the compiler then takes exp from its vector library.
#include <math.h>
#include <omp.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <time.h>

enum { CHANNELS = 3, ROW = 180, ENTRIES = 90 * 90 * ROW, PIECE = 2048, SUMS = 11 };

static double now(void) {
    struct timespec t;
    clock_gettime(CLOCK_MONOTONIC, &t);
    return (double)t.tv_sec + 1e-9 * (double)t.tv_nsec;
}

static void *allocate(size_t count, size_t width) {
    void *memory = aligned_alloc(64, (count * width + 63) / 64 * 64);
    if (!memory) {
        perror("memory");
        exit(1);
    }
    return memory;
}

// Samples: weight Σ cos²θi, ln cosα, and Σ cos²θi f of each channel.
typedef struct {
    int64_t size;
    double *weight, *ln, *data[CHANNELS];
} Samples;

typedef struct {
    float *weight, *ln, *data[CHANNELS];
} SamplesF;

static Samples samples_of(int64_t size) {
    Samples s = {size, allocate(size, 8), allocate(size, 8), {0}};
    for (int c = 0; c < CHANNELS; c++) s.data[c] = allocate(size, 8);
    return s;
}

static float *single(const double *from, int64_t size) {
    float *to = allocate(size, 4);
    for (int64_t i = 0; i < size; i++) to[i] = (float)from[i];
    return to;
}

static SamplesF single_samples(const Samples *s) {
    SamplesF f = {single(s->weight, s->size), single(s->ln, s->size), {0}};
    for (int c = 0; c < CHANNELS; c++) f.data[c] = single(s->data[c], s->size);
    return f;
}

// Where the lobe is dark: far below every argument that exp is given unclamped.
static const double DARK = -1e6;

// Reads a flat file; `entry` receives each sample's place in the grid, `energy` Σ cos²θi f² of all channels.
static Samples read_samples(const char *path, int64_t **entry, double *energy) {
    FILE *file = fopen(path, "rb");
    int64_t size;
    if (!file || fread(&size, 8, 1, file) != 1) {
        perror(path);
        exit(1);
    }
    Samples s = samples_of(size);
    *entry = allocate(size, 8);
    size_t got = fread(*entry, 8, size, file) + fread(s.weight, 8, size, file) + fread(s.ln, 8, size, file);
    for (int c = 0; c < CHANNELS; c++) got += fread(s.data[c], 8, size, file);
    if (got != (size_t)(6 * size)) {
        fprintf(stderr, "%s: too short\n", path);
        exit(1);
    }
    fclose(file);
    *energy = 0;
    for (int64_t i = 0; i < size; i++) {
        s.weight[i] *= s.weight[i];
        s.ln[i] = s.ln[i] > 0 ? log(s.ln[i]) : DARK;
        for (int c = 0; c < CHANNELS; c++) {
            double f = s.data[c][i];
            s.data[c][i] = s.weight[i] * f;
            *energy += s.weight[i] * f * f;
        }
    }
    return s;
}

// Adds up the samples at phi_d and pi - phi_d.
static Samples fold(const Samples *s, const int64_t *entry) {
    int64_t *place = allocate(ENTRIES / 2, 8), size = 0;
    for (int64_t k = 0; k < ENTRIES / 2; k++) place[k] = -1;
    Samples folded = samples_of(s->size);
    for (int64_t i = 0; i < s->size; i++) {
        int64_t row = entry[i] / ROW, phi = entry[i] % ROW;
        int64_t key = row * (ROW / 2) + (phi < ROW / 2 ? phi : ROW - 1 - phi);
        int64_t at = place[key];
        if (at < 0) {
            at = place[key] = size++;
            folded.weight[at] = 0;
            folded.ln[at] = s->ln[i];
            for (int c = 0; c < CHANNELS; c++) folded.data[c][at] = 0;
        }
        folded.weight[at] += s->weight[i];
        for (int c = 0; c < CHANNELS; c++) folded.data[c][at] += s->data[c][i];
    }
    free(place);
    folded.size = size;
    return folded;
}

// One pass. With g = (n+2)/2π cosⁿα and d = ∂g/∂n: Σwg, Σwg², Σwd, Σwgd, Σwd², then Σ(wf)g and Σ(wf)d of each channel.
// The argument of exp is clamped, for it is several times slower where it underflows.
#define PASS(NAME, T, EXP, LEAST)                                                                                      \
    static void NAME(int64_t size, const T *restrict weight, const T *restrict ln, T *const *data, double exponent,    \
                     double *sums) {                                                                                   \
        const T *restrict f0 = data[0], *restrict f1 = data[1], *restrict f2 = data[2];                                \
        const T n = (T)exponent, half = (T)(1 / (2 * M_PI)), norm = (T)((exponent + 2) / (2 * M_PI)), least = LEAST;   \
        memset(sums, 0, SUMS * sizeof *sums);                                                                          \
        _Pragma("omp parallel") {                                                                                      \
            double mine[SUMS] = {0};                                                                                   \
            _Pragma("omp for schedule(static)") for (int64_t begin = 0; begin < size; begin += PIECE) {                \
                const int64_t end = begin + PIECE < size ? begin + PIECE : size;                                       \
                T wg = 0, wgg = 0, wd = 0, wgd = 0, wdd = 0, g0 = 0, g1 = 0, g2 = 0, d0 = 0, d1 = 0, d2 = 0;           \
                _Pragma("omp simd reduction(+ : wg, wgg, wd, wgd, wdd, g0, g1, g2, d0, d1, d2)")                       \
                for (int64_t i = begin; i < end; i++) {                                                                \
                    const T x = n * ln[i], power = EXP(x < least ? least : x);                                         \
                    const T g = norm * power, d = power * (half + norm * ln[i]);                                       \
                    const T a = weight[i] * g, b = weight[i] * d;                                                      \
                    wg += a, wgg += a * g, wd += b, wgd += a * d, wdd += b * d;                                        \
                    g0 += f0[i] * g, g1 += f1[i] * g, g2 += f2[i] * g;                                                 \
                    d0 += f0[i] * d, d1 += f1[i] * d, d2 += f2[i] * d;                                                 \
                }                                                                                                      \
                const T all[SUMS] = {wg, wgg, wd, wgd, wdd, g0, g1, g2, d0, d1, d2};                                   \
                for (int k = 0; k < SUMS; k++) mine[k] += all[k];                                                      \
            }                                                                                                          \
            _Pragma("omp critical") for (int k = 0; k < SUMS; k++) sums[k] += mine[k];                                 \
        }                                                                                                              \
    }
PASS(pass_double, double, exp, -700)
PASS(pass_single, float, expf, -86)

// ½ Σ r² of the best weights, from the sums of a pass.
static double half_cost(const Samples *s, const double *sums, double energy) {
    double total = 0, cost = energy;
    for (int64_t i = 0; i < s->size; i++) total += s->weight[i];
    const double ll = total / (M_PI * M_PI), lg = sums[0] / M_PI, gg = sums[1], det = ll * gg - lg * lg;
    for (int c = 0; c < CHANNELS; c++) {
        double plain = 0;
        for (int64_t i = 0; i < s->size; i++) plain += s->data[c][i];
        const double l = plain / M_PI, g = sums[5 + c];
        cost -= (gg * l * l - 2 * lg * l * g + ll * g * g) / det;
    }
    return cost / 2;
}

static void print_list(const char *name, const double *values, int count) {
    printf("\"%s\": [", name);
    for (int i = 0; i < count; i++) printf("%s%.6g", i ? ", " : "", values[i]);
    printf("]");
}

int main(int argc, char **argv) {
    if (argc != 5) {
        fprintf(stderr, "usage: %s TABLE.flat EXPONENT PASSES THREADS\n", argv[0]);
        return 2;
    }
    const double exponent = atof(argv[2]);
    const int passes = atoi(argv[3]);
    omp_set_num_threads(atoi(argv[4]));
    int64_t *entry;
    double energy;
    const Samples all = read_samples(argv[1], &entry, &energy);
    const Samples folded = fold(&all, entry);
    const SamplesF all_single = single_samples(&all), folded_single = single_samples(&folded);
    double *seconds[4], sums[4][SUMS];
    for (int k = 0; k < 4; k++) seconds[k] = allocate(passes, 8);
    for (int i = 0; i < passes; i++) {
        const double start = now();
        pass_double(all.size, all.weight, all.ln, all.data, exponent, sums[0]);
        const double first = now();
        pass_double(folded.size, folded.weight, folded.ln, folded.data, exponent, sums[1]);
        const double second = now();
        pass_single(all.size, all_single.weight, all_single.ln, all_single.data, exponent, sums[2]);
        const double third = now();
        pass_single(folded.size, folded_single.weight, folded_single.ln, folded_single.data, exponent, sums[3]);
        const double fourth = now();
        seconds[0][i] = first - start, seconds[1][i] = second - first;
        seconds[2][i] = third - second, seconds[3][i] = fourth - third;
    }
    const char *names[4] = {"f64", "f64_folded", "f32", "f32_folded"};
    printf("{\"version\": \"gcc %s\", \"samples\": %lld, \"folded\": %lld, \"exponent\": %.17g, ", __VERSION__,
           (long long)all.size, (long long)folded.size, exponent);
    printf("\"seconds\": {");
    for (int k = 0; k < 4; k++) {
        printf("%s", k ? ", " : "");
        print_list(names[k], seconds[k], passes);
    }
    printf("}, \"half_cost\": {");
    for (int k = 0; k < 4; k++) {
        printf("%s\"%s\": %.17g", k ? ", " : "", names[k], half_cost(k % 2 ? &folded : &all, sums[k], energy));
    }
    printf("}}\n");
}
