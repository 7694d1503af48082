//! What the solver needs of a problem at a point, reduced to as many rows as there are parameters.

use argmin::core::Error;
use nalgebra::{DMatrix, DVector};

/// A least-squares problem as the solver sees it.
pub trait Linearize {
    /// Σ r² at `p`; not finite where `p` can't be evaluated, which makes the solver try a shorter step.
    ///
    /// # Errors
    /// Whatever must end the search.
    fn cost(&self, p: &DVector<f64>) -> Result<f64, Error>;

    /// The residuals' first-order model at `p`.
    ///
    /// # Errors
    /// Whatever must end the search.
    fn linearize(&self, p: &DVector<f64>) -> Result<Linearization, Error>;
}

/// Residuals r and Jacobian J at a point, reduced to as many rows as there are parameters: |r + Jδ|² = cost + 2 (Rδ)·q + |Rδ|².
#[derive(Debug, Clone)]
pub struct Linearization {
    /// Σ r².
    pub cost: f64,
    /// Any R with RᵀR = JᵀJ: the triangle of a QR factorisation, or a root of the normal matrix.
    pub factor: DMatrix<f64>,
    /// q with Rᵀq = Jᵀr.
    pub rhs: DVector<f64>,
}

impl Linearization {
    /// From residuals and Jacobian, by Householder QR (no squared condition number).
    #[must_use]
    pub fn from_jacobian(residuals: &DVector<f64>, jacobian: DMatrix<f64>) -> Self {
        let qr = jacobian.qr();
        let mut q = residuals.clone();
        qr.q_tr_mul(&mut q);
        let factor = qr.unpack_r();
        Self { cost: residuals.norm_squared(), rhs: q.rows(0, factor.nrows()).into_owned(), factor }
    }

    /// From the normal matrix JᵀJ and Jᵀr; directions in which JᵀJ, its columns scaled to length 1, is 0 to rounding don't move.
    #[must_use]
    pub fn from_normal(cost: f64, normal: DMatrix<f64>, gradient: &DVector<f64>) -> Self {
        if !normal.iter().all(|x| x.is_finite()) {
            return Self { cost: f64::NAN, factor: normal, rhs: gradient.clone() }; // no eigenvalues to look for
        }
        let scale = normal.diagonal().map(|d| if d > 0.0 { d.sqrt() } else { 1.0 });
        let eigen = normal.map_with_location(|i, j, x| x / scale[i] / scale[j]).symmetric_eigen();
        let floor = 1e-15 * eigen.eigenvalues.max().max(0.0);
        let root = eigen.eigenvalues.map(|l| if l > floor { l.sqrt() } else { 0.0 });
        let projected = eigen.eigenvectors.transpose() * gradient.component_div(&scale);
        let rhs = projected.zip_map(&root, |g, r| if r > 0.0 { g / r } else { 0.0 });
        let factor = DMatrix::from_diagonal(&root) * eigen.eigenvectors.transpose() * DMatrix::from_diagonal(&scale);
        Self { cost, factor, rhs }
    }

    /// Whether every number in it is finite.
    #[must_use]
    pub fn is_finite(&self) -> bool {
        let mut numbers = self.factor.iter().chain(self.rhs.iter());
        self.cost.is_finite() && numbers.all(|x| x.is_finite())
    }
}

impl<T: Linearize> Linearize for &T {
    fn cost(&self, p: &DVector<f64>) -> Result<f64, Error> {
        (**self).cost(p)
    }

    fn linearize(&self, p: &DVector<f64>) -> Result<Linearization, Error> {
        (**self).linearize(p)
    }
}
