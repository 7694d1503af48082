//! Layers of a rendered picture: what they hold, and that they change nothing else.
#![allow(clippy::expect_used, clippy::panic)] // these are tests

mod common;

use common::{excess, mean, scene};
use glam::DVec3;
use goniofit::control::Control;
use goniofit::image::{Image, LayerKind, compare};
use goniofit::render::scene::builtin;
use goniofit::render::{LayerSet, Materials, Options, Scene, SceneSpec, render};

const ALL: [LayerKind; 10] = [
    LayerKind::Albedo,
    LayerKind::Normal,
    LayerKind::Depth,
    LayerKind::Samples,
    LayerKind::Direct,
    LayerKind::Indirect,
    LayerKind::Diffuse,
    LayerKind::Glossy1,
    LayerKind::Glossy2,
    LayerKind::Glossy3,
];

fn built(spec: &SceneSpec) -> Scene {
    Scene::build(spec, std::path::Path::new("."), &Materials::new()).expect("builds")
}

fn shot(scene: &Scene, samples: u32, kinds: &[LayerKind]) -> Image {
    let options =
        Options { width: 24, height: 24, samples, seed: 5, layers: LayerSet::of(kinds), ..Options::default() };
    render(scene, &options, Control::silent()).expect("renders").to_image()
}

/// The values of a layer's pixel.
fn at(image: &Image, kind: LayerKind, i: usize) -> Vec<f64> {
    let layer = image.layers.iter().find(|l| l.kind == kind).unwrap_or_else(|| panic!("no layer {kind:?}"));
    layer.planes.iter().map(|p| p[i]).collect()
}

/// Paths that are followed one at a time are the same with and without layers. Scenes that packets can walk through are followed one at a time where
/// layers are asked for: other paths, the same picture.
#[test]
fn layers_change_no_more_than_the_noise_of_the_picture() {
    let scene = built(&builtin("mesh-env").expect("built in"));
    let (without, with) = (shot(&scene, 20, &[]), shot(&scene, 20, &ALL));
    assert!(without.layers.is_empty() && with.layers.len() == ALL.len());
    assert!(without.radiance == with.radiance && without.standard_error == with.standard_error);
    for name in ["sphere", "sphere-on-plane", "cornell", "furnace"] {
        let scene = built(&builtin(name).expect("built in"));
        let (without, with) = (shot(&scene, 64, &[]), shot(&scene, 64, &ALL));
        let found = compare(&without, &with).expect("one size").significance.expect("samples enough");
        assert!(!found.differs && with.layers.len() == ALL.len(), "{name}: {found:?}");
    }
}

#[test]
fn direct_and_indirect_light_add_up_to_the_radiance() {
    let scene = built(&builtin("cornell").expect("built in"));
    let image = shot(&scene, 33, &[LayerKind::Direct, LayerKind::Indirect]);
    let mut indirect_sum = 0.0;
    for i in 0..image.radiance.len() {
        let (direct, indirect) = (at(&image, LayerKind::Direct, i), at(&image, LayerKind::Indirect, i));
        for c in 0..3 {
            let (sum, want) = (direct[c] + indirect[c], image.radiance[i][c]);
            assert!((sum - want).abs() <= 100.0 * f64::EPSILON * want, "pixel {i}, channel {c}: {sum} vs {want}");
            assert!(direct[c] >= 0.0 && indirect[c] >= 0.0);
            indirect_sum += indirect[c];
        }
    }
    assert!(indirect_sum > 1.0, "a closed box has much indirect light");
}

#[test]
fn direct_light_is_that_of_paths_with_one_scattering_event() {
    let spec = builtin("cornell").expect("built in");
    let image = shot(&built(&spec), 256, &[LayerKind::Direct]);
    let options = Options { width: 24, height: 24, samples: 256, seed: 6, ..Options::default() };
    let one = render(&built(&SceneSpec { max_bounces: 1, ..spec }), &options, Control::silent()).expect("renders");
    let (want, noise) = mean(&one);
    let n = image.radiance.len();
    let got = (0..n).map(|i| DVec3::from_slice(&at(&image, LayerKind::Direct, i))).sum::<DVec3>() / n as f64;
    let z = excess(got, want, noise * std::f64::consts::SQRT_2);
    assert!(z < 5.0, "{got} vs {want}: {z} sigma");
    // With one event at most nothing is left for the other layer.
    let scene = built(&builtin("furnace").expect("built in"));
    let image = shot(&scene, 4, &[LayerKind::Indirect]);
    assert!((0..n).all(|i| at(&image, LayerKind::Indirect, i) == [0.0; 3]));
}

#[test]
fn the_first_surface_of_a_sphere_has_its_albedo_normal_and_depth() {
    // The camera looks at a unit sphere from (0, 0, 4); in a furnace its radiance is its directional albedo.
    let image = shot(&built(&builtin("furnace").expect("built in")), 64, &ALL);
    for i in 0..image.radiance.len() {
        let (x, y) = (i % 24, i / 24);
        let normal = DVec3::from_slice(&at(&image, LayerKind::Normal, i));
        assert!(normal.length() < 1.0 + 1e-12 && at(&image, LayerKind::Samples, i) == [64.0]);
        if (x, y) == (0, 0) {
            assert_eq!((normal, at(&image, LayerKind::Depth, i)), (DVec3::ZERO, vec![f64::INFINITY]));
            assert_eq!(at(&image, LayerKind::Albedo, i), [0.0; 3]);
        }
        if (11..13).contains(&x) && (11..13).contains(&y) {
            // A pixel's edge is 2 tan 17.5°·3/24 = 0.079 at the sphere, so normals lean by up to 0.11 from the axis.
            assert!(normal.z > 0.99 && normal.truncate().length() < 0.08, "{normal}");
            let depth = at(&image, LayerKind::Depth, i)[0];
            assert!((3.0..3.01).contains(&depth), "{depth}");
            assert!(at(&image, LayerKind::Albedo, i).iter().all(|a| (a - 0.5).abs() < 1e-12));
        }
    }
}

#[test]
fn a_light_and_phong_s_equation_have_no_albedo_but_a_depth() {
    let text = "version = 1\nname = \"t\"\nmax_bounces = 2\n[camera]\nposition = [0, 0, 4]\ntarget = [0, 0, 0]\nfov_deg = 20\n\
        [materials]\nm = { equation = { ambient = [1, 1, 1], diffuse = [0, 0, 0], specular = [0, 0, 0], alpha = 1 } }\n\
        [[sphere]]\ncenter = [0, 0, 0]\nradius = 2\nmaterial = \"m\"\n[[light.point]]\nposition = [0, 0, 4]\nintensity = [1, 1, 1]\n";
    let image = shot(&scene(text), 4, &ALL);
    assert_eq!(at(&image, LayerKind::Albedo, 300), [0.0; 3]);
    assert!((2.0..2.2).contains(&at(&image, LayerKind::Depth, 300)[0]));
    assert!((at(&image, LayerKind::Direct, 300)[0] - image.radiance[300][0]).abs() < 1e-12);
}

const LOBES: [LayerKind; 4] = [LayerKind::Diffuse, LayerKind::Glossy1, LayerKind::Glossy2, LayerKind::Glossy3];

/// A ball above a floor, of one material, that fill the picture, under a lamp that is not in it and a point; weights of the Lambert lobe and of two Phong lobes.
fn of_lobes(weights: [f64; 3], bounces: u32) -> Scene {
    let [kd, sharp, broad] = weights;
    scene(&format!(
        "version = 1\nname = \"lobes\"\nmax_bounces = {bounces}\n[camera]\nposition = [0, 4, 1]\ntarget = [0, 0, 0]\nfov_deg = 30\n\
         [materials]\nm = {{ kd = [{kd}, {kd}, {}], phong = [{{ ks = [{sharp}, {sharp}, {sharp}], n = 300 }}, {{ ks = [{broad}, 0, {broad}], n = 8 }}] }}\n\
         [[sphere]]\ncenter = [0, 0.5, 0]\nradius = 0.5\nmaterial = \"m\"\n[[plane]]\npoint = [0, 0, 0]\nnormal = [0, 1, 0]\nmaterial = \"m\"\n\
         [[light.quad]]\ncenter = [2, 5, -1]\nu = [1, 0, 0]\nv = [0, 0, 1]\nradiance = [6, 6, 6]\n\
         [[light.point]]\nposition = [-2, 6, 1]\nintensity = [9, 5, 9]\n",
        0.5 * kd
    ))
}

#[test]
fn lobes_add_up_to_the_radiance() {
    let image = shot(&of_lobes([0.3, 0.2, 0.4], 4), 16, &LOBES);
    for i in 0..image.radiance.len() {
        let sum = LOBES.iter().map(|kind| DVec3::from_slice(&at(&image, *kind, i))).sum::<DVec3>();
        let want = DVec3::from(image.radiance[i]);
        assert!((sum - want).abs().max_element() <= 1e-12 * want.max_element(), "pixel {i}: {sum} vs {want}");
        assert_eq!(at(&image, LayerKind::Glossy3, i), [0.0; 3], "there are two Phong lobes");
        assert_eq!(at(&image, LayerKind::Glossy2, i)[1], 0.0, "it is not green");
    }
}

/// After one scattering event each lobe's layer is the picture of a material that has it alone.
#[test]
fn a_lobe_s_layer_is_what_it_would_show_alone() {
    let weights = [0.3, 0.2, 0.4];
    let image = shot(&of_lobes(weights, 1), 256, &LOBES);
    let n = image.radiance.len();
    for (k, kind) in LOBES[..3].iter().enumerate() {
        let alone = std::array::from_fn(|j| if j == k { weights[j] } else { 0.0 });
        let options = Options { width: 24, height: 24, samples: 256, seed: 6, ..Options::default() };
        let (want, noise) = mean(&render(&of_lobes(alone, 1), &options, Control::silent()).expect("renders"));
        let got = (0..n).map(|i| DVec3::from_slice(&at(&image, *kind, i))).sum::<DVec3>() / n as f64;
        let z = excess(got, want, noise * std::f64::consts::SQRT_2);
        println!("{kind:?}: {got} vs {want} ± {noise}");
        assert!(want.max_element() > 0.01 && z < 5.0, "{kind:?}: {got} vs {want}: {z} sigma");
    }
}
