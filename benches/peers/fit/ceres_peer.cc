// Lambert + Phong by Ceres: Levenberg-Marquardt, dense normal equations by Cholesky, hand-written Jacobian.
//
//     ceres_peer TABLE.flat SOLVES THREADS
//
// Parameters: kd[3], ks[3], n. The samples stand in 64 residual blocks, which are what Ceres spreads over threads.
// Prints one JSON object.
#include <ceres/ceres.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <string>
#include <vector>

constexpr int kChannels = 3, kParameters = 7, kBlocks = 64;

struct Table {
  int64_t size = 0;
  std::vector<double> cos_i, ln_alpha;  // ln cos(alpha), -inf where the lobe is dark
  std::vector<double> data[kChannels];  // cos(theta_i) f
};

static Table Read(const char* path) {
  FILE* file = std::fopen(path, "rb");
  Table table;
  const auto take = [&](void* to, size_t width, size_t count) {
    if (!file || std::fread(to, width, count, file) != count) {
      std::fprintf(stderr, "%s: cannot be read\n", path);
      std::exit(1);
    }
  };
  take(&table.size, 8, 1);
  const size_t size = table.size;
  std::vector<int64_t> entry(size);  // place in the grid, of no use here
  take(entry.data(), 8, size);
  table.cos_i.resize(size);
  take(table.cos_i.data(), 8, size);
  table.ln_alpha.resize(size);
  take(table.ln_alpha.data(), 8, size);
  for (double& value : table.ln_alpha) value = value > 0 ? std::log(value) : -INFINITY;
  for (auto& plane : table.data) {
    plane.resize(size);
    take(plane.data(), 8, size);
    for (size_t i = 0; i < size; i++) plane[i] *= table.cos_i[i];
  }
  std::fclose(file);
  return table;
}

// Residuals of the samples [begin, end), the three channels of a sample side by side.
class Block : public ceres::CostFunction {
 public:
  Block(const Table& table, int64_t begin, int64_t end) : table_(table), begin_(begin), end_(end) {
    set_num_residuals(static_cast<int>(kChannels * (end - begin)));
    mutable_parameter_block_sizes()->push_back(kParameters);
  }

  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override {
    const double* p = parameters[0];
    const double norm = (p[6] + 2) / (2 * M_PI);
    double* row = jacobians ? jacobians[0] : nullptr;
    for (int64_t i = begin_; i < end_; i++) {
      const double ln = table_.ln_alpha[i], w = table_.cos_i[i];
      const bool lit = ln > -INFINITY;
      const double power = lit ? w * std::exp(p[6] * ln) : 0;
      const double glossy = norm * power;
      const double slope = lit ? power / (2 * M_PI) + glossy * ln : 0;
      for (int c = 0; c < kChannels; c++) {
        *residuals++ = p[c] * w * (1 / M_PI) + p[3 + c] * glossy - table_.data[c][i];
        if (!row) continue;
        std::fill(row, row + kParameters, 0.0);
        row[c] = w * (1 / M_PI);
        row[3 + c] = glossy;
        row[6] = p[3 + c] * slope;
        row += kParameters;
      }
    }
    return true;
  }

 private:
  const Table& table_;
  const int64_t begin_, end_;
};

int main(int argc, char** argv) {
  if (argc != 4) {
    std::fprintf(stderr, "usage: %s TABLE.flat SOLVES THREADS\n", argv[0]);
    return 2;
  }
  google::InitGoogleLogging(argv[0]);
  const Table table = Read(argv[1]);
  const int solves = std::atoi(argv[2]);
  double p[kParameters];
  ceres::Solver::Summary summary;
  std::string seconds;
  for (int solve = 0; solve < solves; solve++) {
    const auto start = std::chrono::steady_clock::now();
    std::fill(p, p + 6, 0.1);
    p[6] = 20;
    ceres::Problem problem;
    for (int64_t b = 0; b < kBlocks; b++) {
      const int64_t begin = table.size * b / kBlocks, end = table.size * (b + 1) / kBlocks;
      if (begin < end) problem.AddResidualBlock(new Block(table, begin, end), nullptr, p);
    }
    ceres::Solver::Options options;
    options.linear_solver_type = ceres::DENSE_NORMAL_CHOLESKY;
    options.num_threads = std::atoi(argv[3]);
    options.function_tolerance = 1e-9;
    options.max_num_iterations = 200;
    options.logging_type = ceres::SILENT;
    ceres::Solve(options, &problem, &summary);
    const std::chrono::duration<double> taken = std::chrono::steady_clock::now() - start;
    seconds += (solve ? ", " : "") + std::to_string(taken.count());
  }
  std::printf("{\"version\": \"Ceres %s\", \"samples\": %lld, \"seconds\": [%s], ", CERES_VERSION_STRING,
              static_cast<long long>(table.size), seconds.c_str());
  std::printf("\"half_cost\": %.17g, \"kd\": [%.17g, %.17g, %.17g], \"ks\": [%.17g, %.17g, %.17g], \"exponent\": %.17g, ",
              summary.final_cost, p[0], p[1], p[2], p[3], p[4], p[5], p[6]);
  std::printf("\"evaluations\": %d, \"ended\": \"%s\"}\n", summary.num_residual_evaluations,
              ceres::TerminationTypeToString(summary.termination_type));
}
