//! The solver on small problems whose answers are known.

use nalgebra::{DMatrix, DVector};

use super::*;

struct Rosenbrock;

impl Linearize for Rosenbrock {
    fn cost(&self, p: &DVector<f64>) -> Result<f64, Error> {
        Ok((10.0 * (p[1] - p[0] * p[0])).powi(2) + (1.0 - p[0]).powi(2))
    }

    fn linearize(&self, p: &DVector<f64>) -> Result<Linearization, Error> {
        let r = DVector::from_vec(vec![10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]]);
        let j = DMatrix::from_row_slice(2, 2, &[-20.0 * p[0], 10.0, -1.0, 0.0]);
        Ok(Linearization::from_jacobian(&r, j))
    }
}

#[test]
fn the_curved_valley_is_followed_to_its_end() {
    let start = DVector::from_vec(vec![-1.2, 1.0]);
    let out = minimize(Rosenbrock, LevenbergMarquardt::default(), start, 200).expect("runs");
    assert!((out.parameters[0] - 1.0).abs() < 1e-12 && (out.parameters[1] - 1.0).abs() < 1e-12, "{out:?}");
    assert!(out.history.windows(2).all(|w| w[1].cost <= w[0].cost));
}

#[test]
fn a_bound_holds_the_parameter_that_pushes_against_it() {
    let bounds = vec![(-2.0, 0.5), (-10.0, 10.0)];
    let lm = LevenbergMarquardt::bounded(bounds);
    let out = minimize(Rosenbrock, lm, DVector::from_vec(vec![-1.2, 1.0]), 200).expect("runs");
    // On x = ½ the minimum is y = x².
    assert!((out.parameters[0] - 0.5).abs() < 1e-15 && (out.parameters[1] - 0.25).abs() < 1e-9, "{out:?}");
}

#[test]
fn a_column_of_zeros_does_not_stop_the_others() {
    struct Idle;
    impl Linearize for Idle {
        fn cost(&self, p: &DVector<f64>) -> Result<f64, Error> {
            Ok((p[0] - 3.0).powi(2) + 1.0)
        }
        fn linearize(&self, p: &DVector<f64>) -> Result<Linearization, Error> {
            let r = DVector::from_vec(vec![p[0] - 3.0, 1.0]);
            Ok(Linearization::from_jacobian(&r, DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, 0.0])))
        }
    }
    let out = minimize(Idle, LevenbergMarquardt::default(), DVector::from_vec(vec![-7.0, 5.0]), 50).expect("runs");
    assert!((out.parameters[0] - 3.0).abs() < 1e-9 && out.parameters[1] == 5.0, "{out:?}");
}

#[test]
fn the_step_budget_is_kept_and_said() {
    let out = minimize(Rosenbrock, LevenbergMarquardt::default(), DVector::from_vec(vec![-1.2, 1.0]), 3).expect("runs");
    assert_eq!(out.stop, Stop::MaxIterations);
}

#[test]
fn both_ways_to_reduce_a_jacobian_give_the_same_model() {
    let j = DMatrix::from_row_slice(3, 2, &[1.0, 2.0, 0.5, -1.0, 3.0, 0.25]);
    let r = DVector::from_vec(vec![0.3, -0.7, 1.1]);
    let a = Linearization::from_jacobian(&r, j.clone());
    let b = Linearization::from_normal(r.norm_squared(), j.transpose() * &j, &(j.transpose() * &r));
    assert!((a.factor.transpose() * &a.factor - b.factor.transpose() * &b.factor).norm() < 1e-13);
    assert!((a.factor.transpose() * &a.rhs - b.factor.transpose() * &b.rhs).norm() < 1e-13);
}

/// A problem by its residuals; derivatives are central differences.
struct Formula<F> {
    residuals: F,
    bounds: Option<Vec<(f64, f64)>>,
}

impl<F: Fn(&[f64]) -> Vec<f64>> Formula<F> {
    fn free(residuals: F) -> Self {
        Self { residuals, bounds: None }
    }

    fn solve(&self, start: &[f64]) -> Result<Solution, SolveError> {
        solve(self, DVector::from_column_slice(start), &SolverOptions::default())
    }
}

impl<F: Fn(&[f64]) -> Vec<f64>> LeastSquares for Formula<F> {
    fn residuals(&self, p: &DVector<f64>) -> Result<DVector<f64>, Error> {
        Ok(DVector::from_vec((self.residuals)(p.as_slice())))
    }

    fn jacobian(&self, p: &DVector<f64>) -> Result<DMatrix<f64>, Error> {
        let columns = (0..p.len()).map(|k| {
            let h = 6e-6 * p[k].abs().max(1e-6);
            let at = |sign: f64| {
                let mut q = p.clone();
                q[k] += sign * h;
                self.residuals(&q)
            };
            Ok((at(1.0)? - at(-1.0)?) / (2.0 * h))
        });
        Ok(DMatrix::from_columns(&columns.collect::<Result<Vec<_>, Error>>()?))
    }

    fn bounds(&self) -> Option<Vec<(f64, f64)>> {
        self.bounds.clone()
    }
}

/// y = 2 exp(−x/2), with a wave on it that no exponential follows.
fn wavy_decay(p: &[f64]) -> Vec<f64> {
    let y = |x: f64| 2.0 * (-0.5 * x).exp() + 0.05 * (3.0 * x).sin();
    (0..20).map(|i| 0.25 * f64::from(i)).map(|x| p[0] * (-p[1] * x).exp() - y(x)).collect()
}

#[test]
fn the_classics_end_at_their_published_minima() {
    // Moré, Garbow, Hillstrom 1981: name, residuals, start, minimum of Σ r².
    type Residuals = fn(&[f64]) -> Vec<f64>;
    let classics: [(&str, Residuals, &[f64], f64); 7] = [
        ("Rosenbrock", |p| vec![10.0 * (p[1] - p[0] * p[0]), 1.0 - p[0]], &[-1.2, 1.0], 0.0),
        ("Powell singular", powell, &[3.0, -1.0, 0.0, 1.0], 0.0),
        ("Freudenstein-Roth", freudenstein_roth, &[0.5, -2.0], 48.9842),
        ("Brown badly scaled", |p| vec![p[0] - 1e6, p[1] - 2e-6, p[0] * p[1] - 2.0], &[1.0, 1.0], 0.0),
        ("Beale", beale, &[1.0, 1.0], 0.0),
        ("Jennrich-Sampson", jennrich_sampson, &[0.3, 0.4], 124.362),
        ("Kowalik-Osborne", kowalik_osborne, &[0.25, 0.39, 0.415, 0.39], 3.07505e-4),
    ];
    for (name, residuals, start, minimum) in classics {
        let s = Formula::free(residuals).solve(start).expect("solves");
        let (steps, r, j) = (s.history.len() - 1, s.residual_evaluations, s.jacobian_evaluations);
        println!("{name}: cost {:.6e}, {steps} steps, {r} residuals, {j} Jacobians, {:?}", s.cost, s.stop);
        assert!((s.cost - minimum).abs() <= 1e-5 * minimum + 1e-18, "{name}: {} instead of {minimum}", s.cost);
        assert!(s.converged());
    }
}

fn powell(p: &[f64]) -> Vec<f64> {
    let (a, b) = (p[1] - 2.0 * p[2], p[0] - p[3]);
    vec![p[0] + 10.0 * p[1], 5.0_f64.sqrt() * (p[2] - p[3]), a * a, 10.0_f64.sqrt() * b * b]
}

fn freudenstein_roth(p: &[f64]) -> Vec<f64> {
    let (x, y) = (p[0], p[1]);
    vec![-13.0 + x + ((5.0 - y) * y - 2.0) * y, -29.0 + x + ((y + 1.0) * y - 14.0) * y]
}

fn beale(p: &[f64]) -> Vec<f64> {
    [1.5, 2.25, 2.625].iter().zip(1..).map(|(y, i)| y - p[0] * (1.0 - p[1].powi(i))).collect()
}

fn jennrich_sampson(p: &[f64]) -> Vec<f64> {
    (1..=10).map(f64::from).map(|i| 2.0 + 2.0 * i - ((i * p[0]).exp() + (i * p[1]).exp())).collect()
}

fn kowalik_osborne(p: &[f64]) -> Vec<f64> {
    let y = [0.1957, 0.1947, 0.1735, 0.1600, 0.0844, 0.0627, 0.0456, 0.0342, 0.0323, 0.0235, 0.0246];
    let u = [4.0, 2.0, 1.0, 0.5, 0.25, 0.167, 0.125, 0.1, 0.0833, 0.0714, 0.0625];
    y.iter().zip(u).map(|(y, u)| y - p[0] * (u * u + u * p[1]) / (u * u + u * p[2] + p[3])).collect()
}

#[test]
fn a_trial_point_without_a_value_is_a_rejected_step() {
    // From 10 the first undamped step leads to a negative number, whose logarithm is NaN.
    let wide = SolverOptions { radius: 100.0, ..SolverOptions::default() };
    let s = solve(&Formula::free(|p: &[f64]| vec![p[0].ln(), 0.1]), DVector::from_element(1, 10.0), &wide);
    let s = s.expect("solves");
    assert!((s.parameters[0] - 1.0).abs() < 1e-9, "{s:?}");
    assert!(s.history.iter().map(|i| i.rejected).sum::<u32>() > 0, "{s:?}");
}

#[test]
fn a_start_without_a_value_is_an_error_that_names_the_residual() {
    let error = Formula::free(|p: &[f64]| vec![1.0, p[0].ln()]).solve(&[-1.0]).expect_err("no value");
    assert!(matches!(&error, SolveError::NotFinite { what, .. } if what == "residual 1"), "{error}");
}

#[test]
fn a_pinned_parameter_stays_and_the_others_find_their_best() {
    let free = Formula::free(|p: &[f64]| wavy_decay(&[p[0], 0.4])).solve(&[1.0]).expect("solves");
    let pinned = Formula { residuals: wavy_decay, bounds: Some(vec![(-10.0, 10.0), (0.4, 0.4)]) };
    let pinned = pinned.solve(&[1.0, 3.0]).expect("solves");
    assert_eq!(pinned.parameters[1], 0.4);
    assert!((pinned.parameters[0] - free.parameters[0]).abs() < 1e-12);
    let (a, b) = (pinned.standard_errors[0].expect("free"), free.standard_errors[0].expect("free"));
    assert!((a / b - 1.0).abs() < 1e-9 && pinned.standard_errors[1].is_none(), "{a} vs {b}");
}

#[test]
fn a_bound_that_the_minimum_lies_beyond_is_reached_exactly() {
    let bounded = Formula { residuals: wavy_decay, bounds: Some(vec![(0.0, 1.5), (0.0, 5.0)]) };
    let s = bounded.solve(&[1.0, 1.0]).expect("solves");
    let best = Formula::free(|p: &[f64]| wavy_decay(&[1.5, p[0]])).solve(&[1.0]).expect("solves");
    assert_eq!(s.parameters[0], 1.5);
    assert!((s.parameters[1] - best.parameters[0]).abs() < 1e-9, "{s:?}");
}

#[test]
fn parameters_that_only_act_together_are_reported_as_undetermined() {
    // The differences' rounding would pass for a third direction.
    let options = SolverOptions { rank_tol: 1e-7, ..SolverOptions::default() };
    let problem = Formula::free(|p: &[f64]| wavy_decay(&[p[0] + 2.0 * p[2], p[1]]));
    let s = solve(&problem, DVector::from_element(3, 1.0), &options).expect("solves");
    let full = Formula::free(wavy_decay).solve(&[1.0, 1.0]).expect("solves");
    assert_eq!(s.rank, 2, "{s:?}");
    assert!((s.cost / full.cost - 1.0).abs() < 1e-12, "{s:?}");
    assert!(s.standard_errors[0].is_none() && s.standard_errors[2].is_none() && s.covariance.is_none());
    let (a, b) = (s.standard_errors[1].expect("determined"), full.standard_errors[1].expect("determined"));
    assert!((a / b - 1.0).abs() < 1e-6, "{a} vs {b}");
}

#[test]
fn fewer_residuals_than_parameters_are_met_exactly() {
    let s = Formula::free(|p: &[f64]| vec![p[0] + p[1] - 3.0]).solve(&[0.0, 0.0]).expect("solves");
    assert!(s.cost < 1e-28 && s.rank == 1 && s.standard_errors == [None, None], "{s:?}");
}

#[test]
fn two_runs_give_the_same_bits() {
    let run = || Formula::free(wavy_decay).solve(&[1.0, 1.0]).expect("solves");
    let (a, b) = (run(), run());
    assert_eq!(a.parameters, b.parameters);
    assert_eq!(a.history, b.history);
    assert_eq!(a.standard_errors, b.standard_errors);
}

#[test]
fn what_cannot_be_used_is_refused_by_name() {
    let bad = |bounds| Formula { residuals: wavy_decay, bounds: Some(bounds) }.solve(&[1.0, 1.0]).expect_err("refused");
    assert!(matches!(bad(vec![(0.0, 1.0)]), SolveError::BoundsCount { found: 1, expected: 2 }));
    assert!(matches!(bad(vec![(0.0, 1.0), (2.0, 1.0)]), SolveError::Bounds { index: 1, .. }));
    assert!(matches!(bad(vec![(0.0, 1.0), (f64::NAN, 1.0)]), SolveError::Bounds { index: 1, .. }));
    let start = Formula::free(wavy_decay).solve(&[1.0, f64::INFINITY]).expect_err("refused");
    assert!(matches!(start, SolveError::Start { index: 1, .. }));
    let options = SolverOptions { xtol: -1.0, ..SolverOptions::default() };
    let refused = solve(&Formula::free(wavy_decay), DVector::from_element(2, 1.0), &options).expect_err("refused");
    assert_eq!(refused.to_string(), "solver option xtol is -1; it must be in [0, 1)");
}

#[test]
fn a_problem_s_own_error_comes_out() {
    struct Broken;
    impl LeastSquares for Broken {
        fn residuals(&self, _: &DVector<f64>) -> Result<DVector<f64>, Error> {
            Err(Error::msg("the instrument is off"))
        }
        fn jacobian(&self, _: &DVector<f64>) -> Result<DMatrix<f64>, Error> {
            Ok(DMatrix::zeros(0, 1))
        }
    }
    let error = solve(&Broken, DVector::zeros(1), &SolverOptions::default()).expect_err("broken");
    assert_eq!(error.to_string(), "the instrument is off");
}

#[test]
fn a_normal_matrix_that_is_not_finite_is_said_to_be() {
    let at = Linearization::from_normal(1.0, DMatrix::from_element(2, 2, f64::NAN), &DVector::zeros(2));
    assert!(!at.is_finite());
}

#[test]
fn every_way_in_refuses_what_cannot_be_used() {
    let refused = |solver: LevenbergMarquardt, start: [f64; 2]| {
        let start = DVector::from_column_slice(&start);
        let problem = Formula::free(wavy_decay);
        let short = minimize(Adapter::new(&problem), solver.clone(), start.clone(), 10).expect_err("refused");
        let configure = |state: argmin::core::IterState<_, (), (), (), (), f64>| state.param(start);
        let own = Executor::new(Adapter::new(&problem), solver).configure(configure).run().map(|_| ());
        let (short, own) = (SolveError::from(short), SolveError::from(own.expect_err("refused")));
        assert_eq!(short.to_string(), own.to_string());
        own
    };
    let options = |radius| LevenbergMarquardt::new(SolverOptions { radius, ..SolverOptions::default() });
    assert!(matches!(refused(options(-1.0), [1.0, 1.0]), SolveError::Option { field: "radius", .. }));
    let bounded = LevenbergMarquardt::bounded;
    assert!(matches!(refused(bounded(vec![(0.0, 1.0)]), [1.0; 2]), SolveError::BoundsCount { found: 1, expected: 2 }));
    assert!(matches!(refused(bounded(vec![(0.0, 1.0), (2.0, 1.0)]), [1.0; 2]), SolveError::Bounds { index: 1, .. }));
    assert!(matches!(refused(options(1.0), [1.0, f64::NAN]), SolveError::Start { index: 1, .. }));
}

#[test]
fn a_run_by_the_executor_ends_where_solve_does_and_says_as_much() {
    let problem = Formula::free(wavy_decay);
    let solved = problem.solve(&[1.0, 1.0]).expect("solves");
    let run = |most| {
        let start = DVector::from_element(2, 1.0);
        let configure = |state: argmin::core::IterState<_, (), (), (), (), f64>| state.param(start).max_iters(most);
        let solver = LevenbergMarquardt::default();
        Executor::new(Adapter::new(&problem), solver).configure(configure).run().expect("runs").solver
    };
    assert_eq!((run(1000).stop(), run(1000).history()), (Some(solved.stop), solved.history.as_slice()));
    let cut = run(2);
    assert_eq!((cut.stop(), cut.history()), (None, &solved.history[..3]));
}
