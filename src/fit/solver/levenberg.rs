//! The search: damped steps accepted by the cost, as an argmin [`Solver`].

use argmin::core::{Error, IterState, KV, Problem, Solver, State, TerminationReason};
use nalgebra::DVector;

use super::linearize::Linearize;
use super::local::{Bounds, Local, Step, relative_length};
use super::options::SolverOptions;
use super::polish::Polish;
use super::radius::Radius;
use super::summary::{Iteration, Stop};
use crate::numeric::float::larger;

/// Below this relative offset of the undamped step the cost can't tell points apart any more: its change is the offset's square.
const COST_IS_BLIND: f64 = 1e-8;

/// Share of a column's scale that one accepted step lets go at most: a column that fades must not let its parameter run away, and one
/// that was long far from here must not bind its parameter for ever.
const FADE: f64 = 0.9;

/// The solver: its options, the ranges of the parameters and the state of one search.
#[derive(Debug, Clone, Default)]
pub struct LevenbergMarquardt {
    /// Tolerances and budgets.
    pub options: SolverOptions,
    pub(super) stop: Option<Stop>,
    pub(super) history: Vec<Iteration>,
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

    /// Last accepted point.
    pub(super) fn into_parts(self) -> (Option<Local>, Option<Stop>, Vec<Iteration>) {
        (self.here, self.stop, self.history)
    }

    fn newton(&self, at: &Local) -> Step {
        let unit = at.lengths.map(|l| if l > 0.0 { l } else { 1.0 });
        at.step(0.0, &unit, &self.bounds, self.options.rank_tol)
    }

    /// One damped step that lowers the cost, or the reason why there is none.
    fn search<O: Linearize>(&mut self, problem: &mut Problem<O>, here: Local) -> Result<Option<Stop>, Error> {
        loop {
            let tried = self.radius.step(&here, &self.scale, &self.bounds, self.options.rank_tol);
            let length = relative_length(&tried.step.delta, &here.p, &self.scale);
            if !(length > self.options.xtol) {
                self.here = Some(here);
                return Ok(Some(Stop::Step { length }));
            }
            let predicted = here.predicted(&tried.step.delta);
            match self.trial(problem, &here, &tried.step)? {
                Some(next) => {
                    let ratio = (here.at.cost - next.at.cost) / predicted;
                    self.radius.update(ratio, &tried);
                    self.accept(next, tried.damping, length, ratio);
                    return Ok(None);
                }
                None => {
                    self.radius.update(f64::NAN, &tried);
                    self.rejected += 1;
                }
            }
        }
    }

    /// The point that a step leads to, if it is a better one.
    fn trial<O: Linearize>(&self, problem: &mut Problem<O>, here: &Local, step: &Step) -> Result<Option<Local>, Error> {
        if !step.to.iter().all(|x| x.is_finite()) {
            return Ok(None);
        }
        let cost = problem.problem("cost_count", |o| o.cost(&step.to))?;
        if !(cost < here.at.cost) {
            return Ok(None); // a NaN is no improvement
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
        let rank = self.newton(at).rank;
        self.history.push(Iteration {
            cost: at.at.cost,
            parameters: at.p.as_slice().to_vec(),
            damping,
            length,
            cosine: at.largest_cosine(),
            ratio,
            rejected: std::mem::take(&mut self.rejected),
            rank,
        });
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

    /// A step of the search, or the change to polishing; says when all is done.
    fn advance<O: Linearize>(&mut self, problem: &mut Problem<O>, here: Local) -> Result<Option<Stop>, Error> {
        if let Some(polish) = self.polish.take() {
            return self.polish_step(problem, here, polish);
        }
        let newton = self.newton(&here);
        let stop = self.stationary(&here, &newton);
        if stop.is_none() && (self.options.polish == 0 || here.offset(&newton.delta) > self.polish_below) {
            let stop = self.search(problem, here)?;
            return Ok(if self.options.polish == 0 { stop } else { self.begin_polish(stop) });
        }
        self.here = Some(here);
        if self.options.polish == 0 {
            Ok(stop)
        } else {
            self.polish = None;
            Ok(self.begin_polish_with(stop, newton))
        }
    }

    fn begin_polish(&mut self, found: Option<Stop>) -> Option<Stop> {
        let here = self.here.as_ref()?;
        if found.is_some() {
            let newton = self.newton(here);
            return self.begin_polish_with(found, newton);
        }
        None
    }

    fn begin_polish_with(&mut self, found: Option<Stop>, newton: Step) -> Option<Stop> {
        let here = self.here.as_ref()?;
        if here.at.cost <= 0.0 || newton.delta.iter().all(|d| *d == 0.0) {
            return found.or(Some(Stop::Step { length: 0.0 }));
        }
        self.polish = Some(Polish::new(here, newton, found));
        None
    }

    /// One trial of the polish.
    fn polish_step<O: Linearize>(
        &mut self,
        problem: &mut Problem<O>,
        here: Local,
        mut polish: Polish,
    ) -> Result<Option<Stop>, Error> {
        let to = self.bounds.project(&polish.proposal(&here));
        let moves = to != here.p && to.iter().all(|x| x.is_finite());
        let mut over = !moves;
        let mut best = here;
        if moves {
            polish.tried += 1;
            let at = problem.problem("linearize_count", |o| o.linearize(&to))?;
            let trial = Local::new(to, at, &self.bounds);
            let finite = trial.at.is_finite();
            let step = if finite { Some(self.newton(&trial)) } else { None };
            match step.filter(|s| polish.improves(&best, &trial, s)) {
                Some(step) => {
                    let delta = &trial.p - &best.p;
                    let length = relative_length(&delta, &best.p, &self.scale);
                    let ratio = (best.at.cost - trial.at.cost) / best.predicted(&delta);
                    self.record(&trial, 0.0, length, ratio);
                    polish.accept(&trial, step);
                    best = trial;
                }
                None if polish.is_mixing() => polish.forget(),
                None => over = true,
            }
        } else if polish.is_mixing() {
            polish.forget();
            over = false;
        }
        over |= polish.tried >= self.options.polish;
        let length = relative_length(&polish.step.delta, &best.p, &self.scale);
        self.here = Some(best);
        if !over {
            self.polish = Some(polish);
            return Ok(None);
        }
        if polish.found.is_none() && polish.offset > COST_IS_BLIND {
            self.polish_below = 0.01 * self.polish_below;
            return Ok(None);
        }
        if polish.accepted > 0 || polish.found.is_none() {
            return Ok(Some(Stop::Rounding { length, offset: polish.offset }));
        }
        Ok(polish.found)
    }
}

impl<O: Linearize> Solver<O, LmState> for LevenbergMarquardt {
    fn name(&self) -> &'static str {
        "Levenberg-Marquardt"
    }

    fn init(&mut self, problem: &mut Problem<O>, mut state: LmState) -> Result<(LmState, Option<KV>), Error> {
        let start = state.take_param().ok_or_else(|| Error::msg("Levenberg-Marquardt needs a start"))?;
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
