//! Parameters by name.

use super::Shapes;
use super::warnings::Ended;
use crate::brdf::{LobeKind, LobeRecord, Material, PerChannel};

/// What lobe `l` of these kinds is called: `phong`, `phong[1]` for the second of the kind.
pub(super) fn lobe_name(kinds: &[LobeKind], l: usize) -> String {
    match kinds[..l].iter().filter(|k| **k == kinds[l]).count() {
        0 => kinds[l].name().into(),
        k => format!("{}[{k}]", kinds[l].name()),
    }
}

/// Names of the parameters without a standard error: `phong.exponent`, `lambert.weight[g]`, `phong[1].exponent`.
pub(super) fn without_error(material: &Material, errors: &[LobeRecord<Option<f64>>]) -> Vec<String> {
    let mut names = Vec::new();
    for (l, error) in errors.iter().enumerate() {
        let lobe = material.lobe_name(l);
        let open = error.weight.iter().zip(&material.channels).filter(|(e, _)| e.is_none());
        names.extend(open.map(|(_, c)| format!("{lobe}.weight[{c}]")));
        let open = shape_names(material, l, &error.shape, |e| e.is_none().then_some(()));
        names.extend(open.into_iter().map(|(name, ())| name));
    }
    names
}

/// Names of the weights that are marked, `[lobe][channel]`.
pub(super) fn weights(material: &Material, marked: &[Vec<bool>]) -> Vec<String> {
    let of_lobe = |(l, marked): (usize, &Vec<bool>)| {
        let own = marked.iter().zip(&material.channels).filter(|(marked, _)| **marked);
        own.map(|(_, c)| format!("{}.weight[{c}]", material.lobe_name(l))).collect::<Vec<_>>()
    };
    marked.iter().enumerate().flat_map(of_lobe).collect()
}

/// The shapes that ended at an end of their range, by name.
pub(super) fn ended(material: &Material, at_end: &[Shapes<Option<Ended>>]) -> Vec<(String, Ended)> {
    let of_lobe = |(l, shapes)| shape_names(material, l, shapes, |ended: &Option<Ended>| *ended);
    at_end.iter().enumerate().flat_map(of_lobe).collect()
}

/// What there is to tell of the shapes of lobe `l`, by name.
fn shape_names<T, U>(
    material: &Material,
    l: usize,
    shapes: &Shapes<T>,
    tell: impl Fn(&T) -> Option<U>,
) -> Vec<(String, U)> {
    let lobe = material.lobe_name(l);
    let mut told = Vec::new();
    for (name, value) in shapes {
        match value {
            PerChannel::Shared(value) => told.extend(tell(value).map(|t| (format!("{lobe}.{name}"), t))),
            PerChannel::Each(list) => {
                let each = list.iter().zip(&material.channels);
                told.extend(each.filter_map(|(value, c)| tell(value).map(|t| (format!("{lobe}.{name}[{c}]"), t))));
            }
        }
    }
    told
}
