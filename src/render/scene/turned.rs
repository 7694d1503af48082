//! The meshes that the program makes: each is a profile that is turned about an axis or drawn along one.

use std::f64::consts::{FRAC_PI_2, TAU};

use glam::{DVec2, DVec3};

use super::super::shapes::Mesh;
use super::icosphere;
use super::spec::BuiltInMesh;

impl BuiltInMesh {
    /// Its triangles, with coordinates that a file of 32-bit floats could hold; with their vertex normals if they have any
    /// and are asked for.
    pub(crate) fn mesh(self, vertex_normals: bool) -> Mesh {
        let mesh = match self {
            Self::DisplacedIcosphere => icosphere::mesh(),
            Self::RoundedDisc => turned(&disc_profile(), 256),
            Self::Cove => drawn(&cove_profile(), 30.0),
        };
        Mesh { normals: if vertex_normals { mesh.normals } else { Vec::new() }, ..mesh }
    }
}

/// A point of a profile and its unit normal.
type Knot = (DVec2, DVec2);

/// A stretch of a profile between two points.
type Stretch = [Knot; 2];

fn straight(from: DVec2, to: DVec2) -> Stretch {
    let normal = (to - from).normalize().perp(); // on the left of the way
    [(from, normal), (to, normal)]
}

/// An arc about `center` in `steps` stretches; the normals point away from the centre for `side` 1, to it for −1.
fn arc(center: DVec2, radius: f64, angles: [f64; 2], steps: u32, side: f64) -> Vec<Stretch> {
    let knot = |i: u32| {
        let away = DVec2::from_angle(angles[0] + (angles[1] - angles[0]) * f64::from(i) / f64::from(steps));
        (center + radius * away, side * away)
    };
    (0..steps).map(|i| [knot(i), knot(i + 1)]).collect()
}

/// Radius and height of a disc, from the axis over its upper side, the rounded edge and the rim to its under side.
fn disc_profile() -> Vec<Stretch> {
    const HEIGHT: f64 = 0.16;
    const ROUND: f64 = 0.05;
    let at = DVec2::new;
    let mut profile = vec![straight(at(0.0, HEIGHT), at(1.0 - ROUND, HEIGHT))];
    profile.extend(arc(at(1.0 - ROUND, HEIGHT - ROUND), ROUND, [FRAC_PI_2, 0.0], 24, 1.0));
    profile.push(straight(at(1.0, HEIGHT - ROUND), at(1.0, 0.0)));
    profile.push(straight(at(1.0, 0.0), at(0.0, 0.0)));
    profile
}

/// z and height of a floor, the bend and a wall.
fn cove_profile() -> Vec<Stretch> {
    let at = DVec2::new;
    let mut profile = vec![straight(at(-8.0, 16.0), at(-8.0, 6.0))];
    profile.extend(arc(at(-2.0, 6.0), 6.0, [2.0 * FRAC_PI_2, 3.0 * FRAC_PI_2], 64, -1.0));
    profile.push(straight(at(-2.0, 0.0), at(30.0, 0.0)));
    profile
}

/// The profile turned about +y, in `sectors` sectors.
fn turned(profile: &[Stretch], sectors: u32) -> Mesh {
    let mut mesh = Mesh::default();
    for sector in 0..sectors {
        let [near, far] =
            [sector, (sector + 1) % sectors].map(|k| DVec2::from_angle(f64::from(k) * TAU / f64::from(sectors)));
        let turn = |p: DVec2, by: DVec2| DVec3::new(p.x * by.x, p.y, -p.x * by.y);
        for [from, to] in profile {
            let corners = [(from, near), (to, near), (to, far), (from, far)];
            add_quad(&mut mesh, corners.map(|((p, n), by)| (turn(*p, by), turn(*n, by))));
        }
    }
    mesh
}

/// The profile of z and y drawn along x from −`half` to `half`.
fn drawn(profile: &[Stretch], half: f64) -> Mesh {
    let mut mesh = Mesh::default();
    for [from, to] in profile {
        let corners = [(from, -half), (to, -half), (to, half), (from, half)];
        add_quad(&mut mesh, corners.map(|((p, n), x)| (DVec3::new(x, p.y, p.x), DVec3::new(0.0, n.y, n.x))));
    }
    mesh
}

/// Adds two triangles, or one where a corner is there twice, that turn counter-clockwise about their normals.
fn add_quad(mesh: &mut Mesh, corners: [(DVec3, DVec3); 4]) {
    let [a, b, c, d] = corners.map(|(p, n)| (p.as_vec3().as_dvec3(), n));
    for [p, q, r] in [[a, b, c], [a, c, d]] {
        let cross = (q.0 - p.0).cross(r.0 - p.0);
        if cross != DVec3::ZERO {
            let [p, q, r] = if cross.dot(p.1 + q.1 + r.1) > 0.0 { [p, q, r] } else { [p, r, q] };
            mesh.triangles.push([p.0, q.0, r.0]);
            mesh.normals.push([p.1, q.1, r.1]);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::PI;

    fn volume(mesh: &Mesh) -> f64 {
        mesh.triangles.iter().map(|[a, b, c]| a.dot(b.cross(*c)) / 6.0).sum()
    }

    #[test]
    fn the_disc_is_closed_and_has_the_volume_of_its_profile() {
        let mesh = BuiltInMesh::RoundedDisc.mesh(true);
        // A cylinder but for what rounding takes off its edge: a square corner without a quarter of a disc, turned (Pappus).
        let r: f64 = 0.05;
        let from_axis = 1.0 - r * (10.0 - 3.0 * PI) / (12.0 - 3.0 * PI);
        let want = PI * 0.16 - TAU * from_axis * r * r * (1.0 - 0.25 * PI);
        // 256 flat sectors lose (2π/256)²/6 = 1.00·10⁻⁴ of it, the 24 chords of the edge r²/2·24·(π/48)³/6 turned, 0.17·10⁻⁴.
        let lost = 1.0 - volume(&mesh) / want;
        assert!((1.16e-4..1.19e-4).contains(&lost), "{} vs {want}: {lost:e}", volume(&mesh));
        let total: DVec3 = mesh.triangles.iter().map(|[a, b, c]| (*b - *a).cross(*c - *a)).sum();
        assert!(total.length() < 1e-6, "a closed surface has no direction: {total}");
    }

    #[test]
    fn vertex_normals_are_those_of_the_smooth_surface() {
        for mesh in [BuiltInMesh::RoundedDisc.mesh(true), BuiltInMesh::Cove.mesh(true)] {
            for ([a, b, c], normals) in mesh.triangles.iter().zip(&mesh.normals) {
                let face = (*b - *a).cross(*c - *a).normalize();
                for n in normals {
                    // A step of the round edge turns by 3.75°, a sector of the disc by 1.4°.
                    assert!((n.length() - 1.0).abs() < 1e-12 && n.dot(face) > 0.997, "{face} vs {n}");
                }
            }
        }
        assert!(BuiltInMesh::Cove.mesh(false).normals.is_empty());
    }
}
