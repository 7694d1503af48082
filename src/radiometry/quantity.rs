//! Quantities with units. A product or quotient of two is the quantity that it is in physics, or it does not compile.
//!
//! The steradian is kept as if it were a unit of its own, and a solid angle seen under a cosine
//! ([`ProjectedSolidAngle`]) is another type than a plain one: so the cosine of ∫ L cosθ dω cannot be forgotten.
//!
//! ```
//! use goniofit::radiometry::*;
//! let radiance = Radiance::new(2.0);
//! let sky: Irradiance = radiance * SolidAngle::new(0.1).projected(0.5);
//! let received: Flux = sky * (Length::new(2.0) * Length::new(3.0));
//! assert_eq!(format!("{:.1}", received * Time::new(10.0)), "6.0 J");
//! ```
//! Forgetting the cosine does not compile:
//! ```compile_fail,E0277
//! use goniofit::radiometry::*;
//! let sky = Radiance::new(2.0) * SolidAngle::new(0.1);
//! ```
//! nor does adding unlike quantities, even of one unit:
//! ```compile_fail,E0308
//! use goniofit::radiometry::*;
//! let sum = Irradiance::new(2.0) + Exitance::new(1.0);
//! ```
//! nor taking a product for what it is not:
//! ```compile_fail,E0308
//! use goniofit::radiometry::*;
//! let radiance: Radiance = Intensity::new(2.0) * SolidAngle::new(0.1);
//! ```
//! nor mixing the worlds, in an operator or in an assignment:
//! ```compile_fail,E0277
//! use goniofit::radiometry::*;
//! let flux = flat::Intensity::new(2.0) * SolidAngle::new(0.1);
//! ```
//! ```compile_fail,E0308
//! use goniofit::radiometry::*;
//! let radiance: Radiance = flat::BrdfValue::new(0.5) * flat::Irradiance::new(2.0);
//! ```

use std::f64::consts::PI;
use std::fmt::Debug;

/// A number with a unit; what an integral over it needs. Implemented for `f64` too, which has no unit.
pub trait Quantity: Copy + Debug + PartialEq + PartialOrd {
    /// The unit, as it is displayed.
    const UNIT: &'static str;
    /// The quantity of `value` units.
    fn new(value: f64) -> Self;
    /// The number of units.
    fn value(self) -> f64;
    /// The quantity itself if it is finite.
    #[must_use]
    fn finite(self) -> Option<Self> {
        self.value().is_finite().then_some(self)
    }
}

impl Quantity for f64 {
    const UNIT: &'static str = "";
    fn new(value: f64) -> Self {
        value
    }
    fn value(self) -> f64 {
        self
    }
}

/// Declares a quantity: a transparent `f64` with a unit, linear arithmetic, and the ratio of two of its kind as a number.
macro_rules! quantity {
    ($(#[$doc:meta])* $name:ident, $unit:literal) => {
        $(#[$doc])*
        #[doc = concat!(" In ", $unit, ".")]
        #[derive(Debug, Clone, Copy, Default, PartialEq, PartialOrd, serde::Serialize, serde::Deserialize)]
        #[serde(transparent)]
        #[repr(transparent)]
        pub struct $name(f64);

        impl $name {
            #[doc = concat!("The quantity of `value` ", $unit, ".")]
            #[must_use]
            pub const fn new(value: f64) -> Self {
                Self(value)
            }
            #[doc = concat!("The number of ", $unit, ".")]
            #[must_use]
            pub const fn value(self) -> f64 {
                self.0
            }
        }
        impl $crate::radiometry::quantity::Quantity for $name {
            const UNIT: &'static str = $unit;
            fn new(value: f64) -> Self {
                Self(value)
            }
            fn value(self) -> f64 {
                self.0
            }
        }
        impl std::fmt::Display for $name {
            fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
                std::fmt::Display::fmt(&self.0, f)?;
                f.write_str(concat!(" ", $unit))
            }
        }
        impl std::ops::Add for $name {
            type Output = Self;
            fn add(self, other: Self) -> Self {
                Self(self.0 + other.0)
            }
        }
        impl std::ops::AddAssign for $name {
            fn add_assign(&mut self, other: Self) {
                self.0 += other.0;
            }
        }
        impl std::ops::Sub for $name {
            type Output = Self;
            fn sub(self, other: Self) -> Self {
                Self(self.0 - other.0)
            }
        }
        impl std::iter::Sum for $name {
            fn sum<I: Iterator<Item = Self>>(terms: I) -> Self {
                terms.fold(Self(0.0), |total, term| total + term)
            }
        }
        impl std::ops::Mul<f64> for $name {
            type Output = Self;
            fn mul(self, factor: f64) -> Self {
                Self(self.0 * factor)
            }
        }
        impl std::ops::Mul<$name> for f64 {
            type Output = $name;
            fn mul(self, quantity: $name) -> $name {
                quantity * self
            }
        }
        impl std::ops::Div<f64> for $name {
            type Output = Self;
            fn div(self, divisor: f64) -> Self {
                Self(self.0 / divisor)
            }
        }
        impl std::ops::Div for $name {
            type Output = f64;
            fn div(self, other: Self) -> f64 {
                self.0 / other.0
            }
        }
    };
}

/// Declares a · b = c, in either order.
macro_rules! product {
    ($a:ty, $b:ty => $c:ty) => {
        impl std::ops::Mul<$b> for $a {
            type Output = $c;
            fn mul(self, other: $b) -> $c {
                <$c as $crate::radiometry::quantity::Quantity>::new(self.value() * other.value())
            }
        }
        impl std::ops::Mul<$a> for $b {
            type Output = $c;
            fn mul(self, other: $a) -> $c {
                other * self
            }
        }
    };
}

/// Declares c / a = b.
macro_rules! quotient {
    ($c:ty, $a:ty => $b:ty) => {
        impl std::ops::Div<$a> for $c {
            type Output = $b;
            fn div(self, other: $a) -> $b {
                <$b>::new(self.value() / other.value())
            }
        }
    };
}

/// Declares a · b = c with both of its quotients.
macro_rules! relate {
    ($($a:ty, $b:ty => $c:ty;)*) => {
        $(
            $crate::radiometry::quantity::product!($a, $b => $c);
            $crate::radiometry::quantity::quotient!($c, $a => $b);
            $crate::radiometry::quantity::quotient!($c, $b => $a);
        )*
    };
}

pub(super) use {product, quantity, quotient, relate};

quantity!(
    /// Radiant energy Q; a photon of visible light has about 4·10⁻¹⁹.
    Energy, "J");
quantity!(
    /// Duration.
    Time, "s");
quantity!(
    /// Radiant flux Φ = dQ/dt; constant in the steady state that all of this describes.
    Flux, "W");
quantity!(
    /// Length; in the flat world the size of a patch.
    Length, "m");
quantity!(
    /// Area.
    Area, "m²");
quantity!(
    /// Solid angle ω: the area of a set of directions on the unit sphere.
    SolidAngle, "sr");
quantity!(
    /// Projected solid angle ∫ cosθ dω: the area of a set of directions, projected onto the surface.
    ProjectedSolidAngle, "sr (projected)");
quantity!(
    /// Radiant intensity I(ω) = dΦ/dω of a point source.
    Intensity, "W/sr");
quantity!(
    /// Irradiance H = dΦ/dA: flux that arrives per area.
    Irradiance, "W/m²");
quantity!(
    /// Radiance L(p, d) = d²Φ/(dA⊥ dω): flux per solid angle and per area seen face-on.
    Radiance, "W/(sr·m²)");
quantity!(
    /// Radiant exitance E = dΦ/dA: flux that leaves per area.
    Exitance, "W/m²");
quantity!(
    /// Value of a BRDF ρ(wi, wo): radiance that leaves along wo per irradiance that arrives from a small cone round wi.
    BrdfValue, "1/sr");

relate! {
    Flux, Time => Energy;
    Intensity, SolidAngle => Flux;
    Irradiance, Area => Flux;
    Radiance, Area => Intensity;
    Radiance, ProjectedSolidAngle => Irradiance;
    BrdfValue, Irradiance => Radiance;
}
// Flux per area is taken for irradiance; exitance says so: `Exitance::of`.
product!(Exitance, Area => Flux);
quotient!(Flux, Exitance => Area);
product!(BrdfValue, ProjectedSolidAngle => f64);

impl std::ops::Mul for Length {
    type Output = Area;
    fn mul(self, other: Self) -> Area {
        Area::new(self.value() * other.value())
    }
}
quotient!(Area, Length => Length);

impl SolidAngle {
    /// All directions, 4π sr.
    pub const SPHERE: Self = Self::new(4.0 * PI);
    /// The directions above a surface, 2π sr.
    pub const HEMISPHERE: Self = Self::new(2.0 * PI);

    /// This (small) solid angle projected onto a surface that sees it under the cosine `cos_theta`; 0 below the horizon.
    #[must_use]
    pub fn projected(self, cos_theta: f64) -> ProjectedSolidAngle {
        ProjectedSolidAngle::new(self.value() * cos_theta.clamp(0.0, f64::INFINITY))
    }
}

impl ProjectedSolidAngle {
    /// All directions above a surface: ∫ cosθ dω = π.
    pub const HEMISPHERE: Self = Self::new(PI);
}

impl Exitance {
    /// The flux that leaves, per area.
    #[must_use]
    pub fn of(leaving: Flux, area: Area) -> Self {
        Self::new(leaving.value() / area.value())
    }
}

impl std::ops::Div<Irradiance> for Exitance {
    /// The share of the arriving light that leaves: the albedo.
    type Output = f64;
    fn div(self, arriving: Irradiance) -> f64 {
        self.value() / arriving.value()
    }
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // exact results are compared exactly
mod tests {
    use super::*;

    #[test]
    fn products_and_quotients_invert_each_other() {
        let (radiance, area) = (Radiance::new(3.0), Area::new(0.5));
        let intensity = radiance * area;
        assert_eq!(intensity / area, radiance);
        assert_eq!(intensity / radiance, area);
        assert_eq!(area * radiance, intensity);
        let energy = intensity * SolidAngle::new(2.0) * Time::new(4.0);
        assert_eq!(energy, Energy::new(12.0));
        assert_eq!(Exitance::of(Flux::new(6.0), area) * area, Flux::new(6.0));
        assert_eq!(BrdfValue::new(0.25) * Irradiance::new(8.0), Radiance::new(2.0));
        assert_eq!(Exitance::new(1.0) / Irradiance::new(4.0), 0.25);
    }

    #[test]
    fn like_quantities_add_scale_and_compare() {
        let total: Flux = [1.0, 2.0, 3.0].into_iter().map(Flux::new).sum();
        assert_eq!(total - Flux::new(1.0), 2.5 * Flux::new(2.0));
        assert!(total > Flux::new(5.0) && total / Flux::new(3.0) == 2.0);
        assert_eq!(Flux::new(f64::NAN).finite(), None);
        assert!(SolidAngle::new(1.0).projected(-0.5).value() == 0.0);
        assert!(SolidAngle::new(1.0).projected(f64::NAN).value().is_nan());
    }

    #[test]
    fn a_quantity_shows_its_unit_and_is_stored_as_a_number() {
        assert_eq!(format!("{:.2}", Radiance::new(1.0 / 3.0)), "0.33 W/(sr·m²)");
        assert_eq!(serde_json::to_string(&Intensity::new(2.5)).expect("a number"), "2.5");
        assert_eq!(serde_json::from_str::<Intensity>("2.5").expect("a number"), Intensity::new(2.5));
    }

    #[test]
    fn a_quantity_is_as_small_as_its_number() {
        assert_eq!(size_of::<Radiance>(), size_of::<f64>());
    }
}
