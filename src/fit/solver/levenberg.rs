//! The search: damped steps accepted by the cost, as an argmin [`Solver`].

use argmin::core::{Error, IterState, KV, Problem, Solver, State, TerminationReason};
use nalgebra::DVector;

use super::error::SolveError;
use super::linearize::Linearize;
use super::local::{Bounds, Local, Step, relative_length};
use super::options::SolverOptions;
use super::polish::Polish;
use super::radius::Radius;
use super::summary::{Iteration, Stop};
use crate::numeric::float::larger;

/// Below this relative offset of the undamped step the cost can't tell points apart any more: its change is the offset's square.
const COST_IS_BLIND: f64 = 1e-8;

/// At a minimum the cost's curvature is positive, so that an undamped step can lower it by twice what it promised at most. A short step
/// that lowers it by more has found rounding, and following that would choose the point where rounding happens to be kindest.
const ROUNDING_RATIO: f64 = 4.0;

/// Relative length below which an undamped step counts as short.
const SHORT: f64 = 1e-6;

/// Share of a column's scale that one accepted step lets go at most: a column that fades must not let its parameter run away, and one
/// that was long far from here must not bind its parameter for ever.
const FADE: f64 = 0.8;

/// The solver: its options, the ranges of the parameters and the state of one search.
#[derive(Debug, Clone, Default)]
pub struct LevenbergMarquardt {
    /// Tolerances and budgets.
    pub options: SolverOptions,
    stop: Option<Stop>,
    history: Vec<Iteration>,
    bounds: Bounds,
    here: Option<Local>,
    /// Length of each column, falling no faster than by [`FADE`] a step.
    scale: DVector<f64>,
    radius: Radius,
    rejected: u32,
    /// Relative offset from which on polishing is tried.
    polish_below: f64,
    polish: Option<Polish>,
}

type LmState = IterState<DVector<f64>, (), (), (), (), f64>;

impl LevenbergMarquardt {
    /// With the given options and no bounds.
    #[must_use]
    pub fn new(options: SolverOptions) -> Self {
        Self { options, ..Self::default() }
    }

    /// With the default options, and an inclusive range for each parameter.
    #[must_use]
    pub fn bounded(bounds: Vec<(f64, f64)>) -> Self {
        Self::default().with_bounds(bounds)
    }

    /// With an inclusive range for each parameter; low = high pins it.
    #[must_use]
    pub fn with_bounds(mut self, bounds: Vec<(f64, f64)>) -> Self {
        self.bounds = Bounds(bounds);
        self
    }

    /// Why the last run stopped; `None` before one, during one, and where the executor ended it (its limit of iterations, say).
    #[must_use]
    pub fn stop(&self) -> Option<Stop> {
        self.stop
    }

    /// The start of the last run and every step it accepted.
    #[must_use]
    pub fn history(&self) -> &[Iteration] {
        &self.history
    }

    /// Whether options, bounds and start can be used.
    pub(super) fn check(&self, start: &DVector<f64>) -> Result<(), SolveError> {
        self.options.validate()?;
        if let Some((index, &value)) = start.iter().enumerate().find(|(_, x)| !x.is_finite()) {
            return Err(SolveError::Start { index, value });
        }
        self.bounds.check(start.len())
    }

    /// The last accepted point, why it is the last, and how it was reached.
    pub(super) fn into_parts(self) -> (Option<Local>, Option<Stop>, Vec<Iteration>) {
        (self.here, self.stop, self.history)
    }

    /// One step of the search or of the polish; says when all is done.
    fn advance<O: Linearize>(&mut self, problem: &mut Problem<O>, here: Local) -> Result<Option<Stop>, Error> {
        if let Some(polish) = self.polish.take() {
            return self.polish_step(problem, here, polish);
        }
        let newton = self.newton(&here);
        let stationary = self.stationary(&here, &newton);
        if stationary.is_some() || (self.options.polish > 0 && here.offset(&newton.delta) <= self.polish_below) {
            self.here = Some(here);
            return Ok(self.begin_polish(stationary));
        }
        let found = self.search(problem, here)?;
        Ok(if found.is_some() { self.begin_polish(found) } else { None })
    }

    /// The undamped step of the linear model, in columns of length 1.
    fn newton(&self, at: &Local) -> Step {
        let unit = at.lengths.map(|l| if l > 0.0 { l } else { 1.0 });
        at.step(0.0, &unit, &self.bounds, self.options.rank_tol)
    }

    /// Why the model itself says that the search is over.
    fn stationary(&self, here: &Local, newton: &Step) -> Option<Stop> {
        let cosine = here.largest_cosine();
        if here.at.cost <= 0.0 || cosine <= self.options.gtol {
            return Some(Stop::Gradient { cosine });
        }
        let change = here.offset(&newton.delta).powi(2);
        (change <= self.options.ftol).then_some(Stop::Cost { change })
    }

    /// One step within the radius that lowers the cost, or the reason why there is none.
    fn search<O: Linearize>(&mut self, problem: &mut Problem<O>, here: Local) -> Result<Option<Stop>, Error> {
        loop {
            let tried = self.radius.step(&here, &self.scale, &self.bounds, self.options.rank_tol);
            let length = relative_length(&tried.step.delta, &here.p, &self.scale);
            if length.is_nan() || length <= self.options.xtol {
                self.here = Some(here);
                return Ok(Some(Stop::Step { length }));
            }
            if let Some(next) = self.trial(problem, &here, &tried.step)? {
                let predicted = here.predicted(&tried.step.delta);
                let ratio = (here.at.cost - next.at.cost) / predicted;
                if tried.damping == 0.0 && length < SHORT && ratio > ROUNDING_RATIO {
                    let change = predicted / here.at.cost;
                    self.here = Some(here);
                    return Ok(Some(Stop::Cost { change }));
                }
                self.radius.update(Some(ratio), &tried);
                self.accept(next, tried.damping, length, ratio);
                return Ok(None);
            }
            self.radius.update(None, &tried);
            self.rejected += 1;
        }
    }

    /// The point that a step leads to, if it is a better one.
    fn trial<O: Linearize>(&self, problem: &mut Problem<O>, here: &Local, step: &Step) -> Result<Option<Local>, Error> {
        if !step.to.iter().all(|x| x.is_finite()) {
            return Ok(None);
        }
        let cost = problem.problem("cost_count", |o| o.cost(&step.to))?;
        if cost.is_nan() || cost >= here.at.cost {
            return Ok(None);
        }
        let at = problem.problem("linearize_count", |o| o.linearize(&step.to))?;
        Ok(at.is_finite().then(|| Local::new(step.to.clone(), at, &self.bounds)))
    }

    fn accept(&mut self, next: Local, damping: f64, length: f64, ratio: f64) {
        self.record(&next, damping, length, ratio);
        self.scale.zip_apply(&next.lengths, |s, l| *s = larger(FADE * *s, l));
        self.here = Some(next);
    }

    fn record(&mut self, at: &Local, damping: f64, length: f64, ratio: f64) {
        self.history.push(Iteration {
            cost: at.at.cost,
            parameters: at.p.as_slice().to_vec(),
            damping,
            length,
            cosine: at.largest_cosine(),
            ratio,
            rejected: std::mem::take(&mut self.rejected),
            rank: self.newton(at).rank,
        });
    }

    /// Starts a polish at the current point; what was `found` where there is nothing to polish.
    fn begin_polish(&mut self, found: Option<Stop>) -> Option<Stop> {
        let here = self.here.as_ref()?;
        let newton = self.newton(here);
        if self.options.polish == 0 || here.at.cost <= 0.0 || newton.to == here.p {
            return found.or(Some(Stop::Step { length: 0.0 }));
        }
        self.polish = Some(Polish::new(here, newton, found));
        None
    }

    /// One trial of the polish: towards the mix of the last points, or plainly where that fails; if that fails too, it is over.
    fn polish_step<O: Linearize>(
        &mut self,
        problem: &mut Problem<O>,
        here: Local,
        mut polish: Polish,
    ) -> Result<Option<Stop>, Error> {
        let mut goes_on = true;
        let mut best = here;
        if let Some((better, step)) = self.polish_trial(problem, &best, &mut polish)? {
            let delta = &better.p - &best.p;
            let ratio = (best.at.cost - better.at.cost) / best.predicted(&delta);
            self.record(&better, 0.0, relative_length(&delta, &best.p, &self.scale), ratio);
            polish.accept(&better, step);
            best = better;
        } else if polish.is_mixing() {
            polish.forget();
        } else {
            goes_on = false;
        }
        let length = relative_length(&polish.step.delta, &best.p, &self.scale);
        self.here = Some(best);
        if goes_on && polish.tried < self.options.polish {
            self.polish = Some(polish);
            return Ok(None);
        }
        Ok(self.end_polish(&polish, length))
    }

    fn polish_trial<O: Linearize>(
        &self,
        problem: &mut Problem<O>,
        here: &Local,
        polish: &mut Polish,
    ) -> Result<Option<(Local, Step)>, Error> {
        let to = self.bounds.project(&polish.proposal(here));
        if to == here.p || !to.iter().all(|x| x.is_finite()) {
            return Ok(None);
        }
        polish.tried += 1;
        let at = problem.problem("linearize_count", |o| o.linearize(&to))?;
        if !at.is_finite() {
            return Ok(None);
        }
        let trial = Local::new(to, at, &self.bounds);
        let step = self.newton(&trial);
        Ok(polish.improves(here, &trial, &step).then_some((trial, step)))
    }

    /// What the end of a polish means: the end of all, or that the search must first come closer.
    fn end_polish(&mut self, polish: &Polish, length: f64) -> Option<Stop> {
        if polish.found.is_none() && polish.offset > COST_IS_BLIND {
            self.polish_below *= 0.01;
            return None;
        }
        let rounding = Stop::Rounding { length, offset: polish.offset };
        if polish.accepted > 0 { Some(rounding) } else { polish.found.or(Some(rounding)) }
    }
}

impl<O: Linearize> Solver<O, LmState> for LevenbergMarquardt {
    fn name(&self) -> &'static str {
        "Levenberg-Marquardt"
    }

    fn init(&mut self, problem: &mut Problem<O>, mut state: LmState) -> Result<(LmState, Option<KV>), Error> {
        let start = state.take_param().ok_or_else(|| Error::msg("Levenberg-Marquardt needs a start"))?;
        self.check(&start)?;
        let p = self.bounds.project(&start);
        let at = problem.problem("linearize_count", |o| o.linearize(&p))?;
        if !at.is_finite() {
            return Err(Error::msg(format!(
                "the residuals or their Jacobian are not finite at the start {:?}",
                p.as_slice()
            )));
        }
        let here = Local::new(p.clone(), at, &self.bounds);
        let cost = here.at.cost;
        self.polish_below = self.options.polish_below;
        self.scale = here.lengths.map(|l| if l > 0.0 { l } else { 1.0 });
        let length = here.p.component_mul(&self.scale).norm();
        self.radius = Radius(self.options.radius * if length > 0.0 { length } else { 1.0 });
        (self.stop, self.polish, self.rejected) = (None, None, 0);
        self.history.clear();
        self.record(&here, 0.0, 0.0, 0.0);
        self.here = Some(here);
        Ok((state.param(p).cost(cost), None))
    }

    fn next_iter(&mut self, problem: &mut Problem<O>, state: LmState) -> Result<(LmState, Option<KV>), Error> {
        let here = self.here.take().ok_or_else(|| Error::msg("the solver lost its point"))?;
        self.stop = self.advance(problem, here)?;
        let Some(here) = &self.here else { return Err(Error::msg("the solver lost its point")) };
        let state = state.param(here.p.clone()).cost(here.at.cost);
        let done = self.stop.is_some();
        Ok((if done { state.terminate_with(TerminationReason::SolverConverged) } else { state }, None))
    }
}
