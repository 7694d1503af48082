//! Lambert + Phong by published crates.
//!
//!     varpro_peer TABLE.flat varpro|lm SOLVES
//!
//! `varpro`: variable projection by LAPACK's QR, the three channels as right-hand sides of one problem. `lm`: MINPACK's
//! Levenberg–Marquardt on all seven parameters, kd[3], ks[3], n. Prints one JSON object.

use std::convert::Infallible;
use std::f64::consts::PI;
use std::time::Instant;

use levenberg_marquardt::{LeastSquaresProblem, LevenbergMarquardt};
use nalgebra::{DMatrix, DVector, Dyn, Matrix, OVector, Owned, U1, U7, VecStorage};
use varpro::prelude::SeparableNonlinearModel;
use varpro::problem::SeparableProblemBuilder;
use varpro::solvers::levmar::LevMarSolver;

const CHANNELS: usize = 3;
const START_WEIGHT: f64 = 0.1;
const START_EXPONENT: f64 = 20.0;
const TOLERANCE: f64 = 1e-8;

/// The samples: cos θi, ln cos α (−∞ where the lobe is dark), and cos θi · f of each channel.
struct Table {
    cos_i: Vec<f64>,
    ln_alpha: Vec<f64>,
    data: Vec<Vec<f64>>,
}

impl Table {
    fn read(path: &str) -> Self {
        let bytes = std::fs::read(path).unwrap_or_else(|e| panic!("{path}: {e}"));
        // After the number of samples and their places in the grid come the columns.
        let size = u64::from_le_bytes(bytes[..8].try_into().unwrap()) as usize;
        let values: Vec<f64> =
            bytes[8 + 8 * size..].chunks_exact(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
        let mut columns = values.chunks_exact(size).map(<[f64]>::to_vec);
        let cos_i = columns.next().unwrap();
        let ln_alpha =
            columns.next().unwrap().iter().map(|&c| if c > 0.0 { c.ln() } else { f64::NEG_INFINITY }).collect();
        let data: Vec<Vec<f64>> = columns.map(|f| f.iter().zip(&cos_i).map(|(f, w)| f * w).collect()).collect();
        assert_eq!(data.len(), CHANNELS, "{path}: too short");
        Self { cos_i, ln_alpha, data }
    }

    fn len(&self) -> usize {
        self.cos_i.len()
    }

    /// Writes cos θi · max(0, cos α)ⁿ to `power`.
    fn lobe(&self, n: f64, power: &mut [f64]) {
        for ((out, &ln), &w) in power.iter_mut().zip(&self.ln_alpha).zip(&self.cos_i) {
            *out = if ln == f64::NEG_INFINITY { 0.0 } else { (n * ln).exp() * w };
        }
    }

    /// Derivative of (n + 2)/2π · power with respect to n, sample by sample.
    fn lobe_slope<'a>(&'a self, n: f64, power: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
        let lit = |ln: f64| if ln == f64::NEG_INFINITY { 0.0 } else { ln };
        power.iter().zip(&self.ln_alpha).map(move |(p, &ln)| p * (1.0 / (2.0 * PI) + norm(n) * lit(ln)))
    }
}

/// What normalises the lobe: (n + 2)/2π.
fn norm(n: f64) -> f64 {
    (n + 2.0) / (2.0 * PI)
}

/// All seven parameters, residuals channel after channel.
struct Full<'a> {
    table: &'a Table,
    parameters: OVector<f64, U7>,
    power: Vec<f64>,
}

impl LeastSquaresProblem<f64, Dyn, U7> for Full<'_> {
    type ParameterStorage = Owned<f64, U7>;
    type ResidualStorage = VecStorage<f64, Dyn, U1>;
    type JacobianStorage = VecStorage<f64, Dyn, U7>;

    fn set_params(&mut self, parameters: &OVector<f64, U7>) {
        self.parameters.copy_from(parameters);
        self.table.lobe(parameters[6], &mut self.power);
    }

    fn params(&self) -> OVector<f64, U7> {
        self.parameters
    }

    fn residuals(&self) -> Option<OVector<f64, Dyn>> {
        let p = &self.parameters;
        let mut out = Vec::with_capacity(CHANNELS * self.table.len());
        for (c, data) in self.table.data.iter().enumerate() {
            let (diffuse, glossy) = (p[c] / PI, p[3 + c] * norm(p[6]));
            let samples = self.table.cos_i.iter().zip(&self.power).zip(data);
            out.extend(samples.map(|((w, power), f)| diffuse * w + glossy * power - f));
        }
        Some(DVector::from_vec(out))
    }

    fn jacobian(&self) -> Option<Matrix<f64, Dyn, U7, Self::JacobianStorage>> {
        let (p, size) = (&self.parameters, self.table.len());
        let rows = CHANNELS * size;
        let mut out = vec![0.0; rows * 7];
        for c in 0..CHANNELS {
            let at = |column: usize| column * rows + c * size..column * rows + (c + 1) * size;
            out[at(c)].iter_mut().zip(&self.table.cos_i).for_each(|(o, w)| *o = w / PI);
            out[at(3 + c)].iter_mut().zip(&self.power).for_each(|(o, power)| *o = norm(p[6]) * power);
            let slope = self.table.lobe_slope(p[6], &self.power);
            out[at(6)].iter_mut().zip(slope).for_each(|(o, slope)| *o = p[3 + c] * slope);
        }
        Some(Matrix::from_data(VecStorage::new(Dyn(rows), U7, out)))
    }
}

/// The exponent alone; the weights are linear.
struct Separable<'a> {
    table: &'a Table,
    exponent: f64,
    power: Vec<f64>,
}

impl SeparableNonlinearModel for Separable<'_> {
    type ScalarType = f64;
    type Error = Infallible;

    fn parameter_count(&self) -> usize {
        1
    }

    fn base_function_count(&self) -> usize {
        2
    }

    fn output_len(&self) -> usize {
        self.table.len()
    }

    fn set_params(&mut self, parameters: DVector<f64>) -> Result<(), Infallible> {
        self.exponent = parameters[0];
        self.table.lobe(self.exponent, &mut self.power);
        Ok(())
    }

    fn params(&self) -> DVector<f64> {
        DVector::from_vec(vec![self.exponent])
    }

    fn eval(&self) -> Result<DMatrix<f64>, Infallible> {
        let size = self.table.len();
        let mut out = Vec::with_capacity(2 * size);
        out.extend(self.table.cos_i.iter().map(|w| w / PI));
        out.extend(self.power.iter().map(|power| norm(self.exponent) * power));
        Ok(DMatrix::from_vec(size, 2, out))
    }

    fn eval_partial_deriv(&self, _parameter: usize) -> Result<DMatrix<f64>, Infallible> {
        let size = self.table.len();
        let mut out = vec![0.0; 2 * size];
        out[size..].iter_mut().zip(self.table.lobe_slope(self.exponent, &self.power)).for_each(|(o, slope)| *o = slope);
        Ok(DMatrix::from_vec(size, 2, out))
    }
}

/// What a solve found.
struct Found {
    seconds: f64,
    half_cost: f64,
    diffuse: Vec<f64>,
    glossy: Vec<f64>,
    exponent: f64,
    evaluations: usize,
    ended: String,
}

fn solver() -> LevenbergMarquardt<f64> {
    LevenbergMarquardt::new().with_ftol(TOLERANCE).with_xtol(TOLERANCE).with_gtol(TOLERANCE)
}

fn solve_full(table: &Table) -> Found {
    let clock = Instant::now();
    let mut start = OVector::<f64, U7>::repeat(START_WEIGHT);
    start[6] = START_EXPONENT;
    let mut problem = Full { table, parameters: start, power: vec![0.0; table.len()] };
    problem.set_params(&start);
    let (solved, report) = solver().minimize(problem);
    let p = solved.parameters;
    Found {
        seconds: clock.elapsed().as_secs_f64(),
        half_cost: report.objective_function,
        diffuse: p.as_slice()[..3].to_vec(),
        glossy: p.as_slice()[3..6].to_vec(),
        exponent: p[6],
        evaluations: report.number_of_evaluations,
        ended: format!("{:?}", report.termination),
    }
}

fn solve_separable(table: &Table) -> Found {
    let data = DMatrix::from_vec(table.len(), CHANNELS, table.data.concat());
    let clock = Instant::now();
    let model = Separable { table, exponent: START_EXPONENT, power: vec![0.0; table.len()] };
    let problem = SeparableProblemBuilder::mrhs(model).observations(data).build().expect("a problem");
    // An error is a solve that did not converge; its report and coefficients are told all the same.
    let (Ok(fit) | Err(fit)) = LevMarSolver::with_solver(solver()).solve_with_qr(problem);
    let seconds = clock.elapsed().as_secs_f64();
    let weights = fit.linear_coefficients().expect("weights");
    Found {
        seconds,
        half_cost: fit.minimization_report.objective_function,
        diffuse: weights.row(0).iter().copied().collect(),
        glossy: weights.row(1).iter().copied().collect(),
        exponent: fit.nonlinear_parameters()[0],
        evaluations: fit.minimization_report.number_of_evaluations,
        ended: format!("{:?}", fit.minimization_report.termination),
    }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let (path, solve, version, solves) = match arguments.iter().map(String::as_str).collect::<Vec<_>>()[..] {
        [path, "varpro", n] => (path, solve_separable as fn(&Table) -> Found, "varpro 0.14", n.parse()),
        [path, "lm", n] => (path, solve_full as fn(&Table) -> Found, "levenberg-marquardt 0.15", n.parse()),
        _ => panic!("usage: varpro_peer TABLE.flat varpro|lm SOLVES"),
    };
    let table = Table::read(path);
    let found: Vec<Found> = (0..solves.expect("a number of solves")).map(|_| solve(&table)).collect();
    let seconds: Vec<f64> = found.iter().map(|f| f.seconds).collect();
    let last = found.last().expect("at least one solve");
    print!("{{\"version\": \"{version}\", \"samples\": {}, \"seconds\": {seconds:?}, ", table.len());
    print!("\"half_cost\": {:?}, \"kd\": {:?}, \"ks\": {:?}, ", last.half_cost, last.diffuse, last.glossy);
    println!("\"exponent\": {:?}, \"evaluations\": {}, \"ended\": {:?}}}", last.exponent, last.evaluations, last.ended);
}
