//! A pair of directions, its images, and where it stands in a scan.

use glam::DVec3;

use crate::geometry::angles::{phi_of, theta_of};

/// (wi, wo).
pub(super) type Pair = (DVec3, DVec3);

/// Signs of x and y that leave a reading of an isotropic material as it is, but not what errors of positions do to it.
pub(super) const IMAGES: [[f64; 2]; 3] = [TURNED, [1.0, -1.0], [-1.0, 1.0]];
/// Half a turn about the normal.
pub(super) const TURNED: [f64; 2] = [-1.0, -1.0];

/// The image of a pair.
pub(super) fn image((wi, wo): Pair, [x, y]: [f64; 2]) -> Pair {
    // Azimuths of 180°, not of −180°, where y is 0 but for rounding.
    let of = |w: DVec3| DVec3::new(x * w.x, if w.y.abs() < 1e-12 { 0.0 } else { y * w.y }, w.z);
    (of(wi), of(wo))
}

/// Whether two pairs are one but for rounding.
pub(super) fn same(a: Pair, b: Pair) -> bool {
    a.0.distance_squared(b.0) + a.1.distance_squared(b.1) < 1e-12
}

/// Where a pair stands in the order of reading: incidence by incidence, so that the source moves least.
pub(super) fn place((wi, wo): Pair) -> [f64; 4] {
    let turned = wi.x > 1e-9;
    let (wi, wo) = if turned { image((wi, wo), TURNED) } else { (wi, wo) };
    let side = if wo.x < 0.0 { -1.0 } else { 1.0 };
    [f64::from(u8::from(turned)), theta_of(wi), (side * phi_of(side * wo)).abs(), side * theta_of(wo)]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::angles::direction_deg;

    #[test]
    fn readings_are_sorted_by_where_the_source_stands() {
        let at = |i: f64, phi: f64, o: f64| (direction_deg(i, phi), direction_deg(o, 0.0));
        let turned = image(at(30.0, 180.0, 40.0), TURNED);
        assert!(same(image(turned, TURNED), at(30.0, 180.0, 40.0)));
        assert!(turned.0.x > 0.0 && turned.1.x < 0.0);
        assert_eq!(phi_of(image(turned, [-1.0, 1.0]).0), std::f64::consts::PI);
        // All of one azimuth of the source first, by incidence; then those of the other.
        assert!(
            place(at(30.0, 180.0, 40.0)) < place(at(60.0, 180.0, 40.0)) && place(at(60.0, 180.0, 40.0)) < place(turned)
        );
        assert_eq!(place(turned)[1..], place(at(30.0, 180.0, 40.0))[1..]);
    }
}
