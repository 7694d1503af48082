//! Orthonormal frames.

use glam::DVec3;

/// A right-handed orthonormal frame whose third axis is a surface normal.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Frame {
    /// First tangent, the local x axis.
    pub tangent: DVec3,
    /// Second tangent, the local y axis.
    pub bitangent: DVec3,
    /// Normal, the local z axis.
    pub normal: DVec3,
}

impl Frame {
    /// A frame round the unit vector `normal`, without branches that lose digits (Duff et al. 2017, JCGT 6(1)).
    #[must_use]
    pub fn from_normal(normal: DVec3) -> Self {
        let sign = 1.0f64.copysign(normal.z);
        let a = -1.0 / (sign + normal.z);
        let b = normal.x * normal.y * a;
        Self {
            tangent: DVec3::new(1.0 + sign * normal.x * normal.x * a, sign * b, -sign * normal.x),
            bitangent: DVec3::new(b, sign + normal.y * normal.y * a, -normal.y),
            normal,
        }
    }

    /// Coordinates in this frame of the world vector `v`.
    #[must_use]
    pub fn to_local(&self, v: DVec3) -> DVec3 {
        DVec3::new(self.tangent.dot(v), self.bitangent.dot(v), self.normal.dot(v))
    }

    /// The world vector with local coordinates `v`.
    #[must_use]
    pub fn to_world(&self, v: DVec3) -> DVec3 {
        self.tangent * v.x + self.bitangent * v.y + self.normal * v.z
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::direction;

    #[test]
    fn frames_are_orthonormal_right_handed_and_invert() {
        for i in 0..400 {
            let n = direction(0.001 + f64::from(i) * 0.00785, f64::from(i) * 2.4);
            let f = Frame::from_normal(n);
            assert!((f.tangent.cross(f.bitangent) - n).length() < 1e-14, "normal {n}");
            let v = direction(1.1, 0.3 * f64::from(i));
            assert!((f.to_world(f.to_local(v)) - v).length() < 1e-14);
        }
        assert_eq!(Frame::from_normal(DVec3::Z).to_local(DVec3::X), DVec3::X);
        assert!(Frame::from_normal(-DVec3::Z).to_world(DVec3::X).is_finite());
    }
}
