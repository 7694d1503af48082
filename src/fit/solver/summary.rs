//! What a search says about itself: why it stopped, and what each step did.

/// Why the solver stopped.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Stop {
    /// The residuals are 0, or orthogonal to every column of the Jacobian that may move: the largest cosine is `cosine`.
    Gradient {
        /// Largest cosine.
        cosine: f64,
    },
    /// The best step of the linear model would lower the cost by no more than the share `change` of it, or a short one lowered it by
    /// more than any curvature allows: what is left is rounding.
    Cost {
        /// Share predicted.
        change: f64,
    },
    /// No step longer than the share `length` of the parameters lowers the cost.
    Step {
        /// |Dδ| / |Dp|, with D the lengths of the Jacobian's columns.
        length: f64,
    },
    /// Undamped steps shrank until rounding kept the next one, of the share `length` of the parameters, from being shorter still.
    Rounding {
        /// |Dδ| / |Dp| of the step that was left.
        length: f64,
        /// |Jδ| / |r| of it.
        offset: f64,
    },
    /// The allowed number of steps was used up.
    MaxIterations,
}

impl std::fmt::Display for Stop {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Gradient { cosine } => write!(f, "the gradient is 0 (largest cosine {cosine:.1e})"),
            Self::Cost { change } => write!(f, "a step would lower the cost by a share of {change:.1e} at most"),
            Self::Step { length } => write!(f, "no step longer than a share of {length:.1e} lowers the cost"),
            Self::Rounding { length, offset } => {
                write!(f, "down to rounding (a step of a share of {length:.1e} is left, of the residuals {offset:.1e})")
            }
            Self::MaxIterations => f.write_str("the allowed number of steps was used up"),
        }
    }
}

/// The start, or one accepted step.
#[derive(Debug, Clone, PartialEq)]
pub struct Iteration {
    /// Cost after it.
    pub cost: f64,
    /// Parameters after it.
    pub parameters: Vec<f64>,
    /// Damping that it was taken with; 0 for a polishing step.
    pub damping: f64,
    /// Its length |Dδ| / |Dp|; 0 at the start.
    pub length: f64,
    /// Largest cosine between the residuals and a free column after it.
    pub cosine: f64,
    /// Reduction of the cost found, as a share of the predicted one. A polishing step's says little: both drown in rounding.
    pub ratio: f64,
    /// Trial steps rejected since the previous accepted one.
    pub rejected: u32,
    /// Rank of the Jacobian's free columns after it.
    pub rank: usize,
}
