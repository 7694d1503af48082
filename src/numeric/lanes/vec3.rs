//! Vectors of three, side by side.

use std::ops::{Add, Mul, Neg, Sub};

use glam::DVec3;

use super::{Lanes, Mask};
use crate::numeric::simd::Simd;

/// Vectors side by side.
#[must_use]
#[derive(Debug, Clone, Copy)]
#[allow(missing_docs)] // x, y, z
pub struct Vec3<S: Simd> {
    pub x: Lanes<S>,
    pub y: Lanes<S>,
    pub z: Lanes<S>,
}

impl<S: Simd> Vec3<S> {
    /// The same vector in every lane.
    #[inline(always)]
    pub fn splat(simd: S, v: DVec3) -> Self {
        Self { x: Lanes::splat(simd, v.x), y: Lanes::splat(simd, v.y), z: Lanes::splat(simd, v.z) }
    }

    /// From its components.
    #[inline(always)]
    pub fn new(x: Lanes<S>, y: Lanes<S>, z: Lanes<S>) -> Self {
        Self { x, y, z }
    }

    /// `v` in every lane.
    #[inline(always)]
    pub fn vector(self, v: DVec3) -> Self {
        Self::splat(self.x.simd, v)
    }

    /// The dot product.
    #[inline(always)]
    pub fn dot(self, other: Self) -> Lanes<S> {
        self.x.mul_add(other.x, self.y.mul_add(other.y, self.z * other.z))
    }

    /// |self|².
    #[inline(always)]
    pub fn length_squared(self) -> Lanes<S> {
        self.dot(self)
    }

    /// Of length 1.
    #[inline(always)]
    pub fn normalize(self) -> Self {
        self * (self.x.number(1.0) / self.length_squared().sqrt())
    }

    /// self·s + b.
    #[inline(always)]
    pub fn scaled_plus(self, s: Lanes<S>, b: Self) -> Self {
        Self { x: self.x.mul_add(s, b.x), y: self.y.mul_add(s, b.y), z: self.z.mul_add(s, b.z) }
    }

    /// Absolute values.
    #[inline(always)]
    pub fn abs(self) -> Self {
        Self { x: self.x.abs(), y: self.y.abs(), z: self.z.abs() }
    }

    /// The largest component.
    #[inline(always)]
    pub fn largest(self) -> Lanes<S> {
        self.x.max(self.y).max(self.z)
    }

    /// Component by component.
    #[inline(always)]
    pub fn times(self, other: Self) -> Self {
        Self { x: self.x * other.x, y: self.y * other.y, z: self.z * other.z }
    }
}

impl<S: Simd> Add for Vec3<S> {
    type Output = Self;

    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self { x: self.x + other.x, y: self.y + other.y, z: self.z + other.z }
    }
}

impl<S: Simd> Sub for Vec3<S> {
    type Output = Self;

    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self { x: self.x - other.x, y: self.y - other.y, z: self.z - other.z }
    }
}

impl<S: Simd> Neg for Vec3<S> {
    type Output = Self;

    #[inline(always)]
    fn neg(self) -> Self {
        Self { x: -self.x, y: -self.y, z: -self.z }
    }
}

impl<S: Simd> Mul<Lanes<S>> for Vec3<S> {
    type Output = Self;

    #[inline(always)]
    fn mul(self, s: Lanes<S>) -> Self {
        Self { x: self.x * s, y: self.y * s, z: self.z * s }
    }
}

impl<S: Simd> Mask<S> {
    /// [`Mask::select`] for vectors.
    #[inline(always)]
    pub fn select3(self, yes: Vec3<S>, no: Vec3<S>) -> Vec3<S> {
        Vec3 { x: self.select(yes.x, no.x), y: self.select(yes.y, no.y), z: self.select(yes.z, no.z) }
    }

    /// [`Mask::keep`] for a vector.
    #[inline(always)]
    pub fn keep3(self, of: Vec3<S>) -> Vec3<S> {
        self.select3(of, Vec3::splat(self.simd, DVec3::ZERO))
    }
}
