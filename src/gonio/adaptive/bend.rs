//! Where readings bend: how far each lies off the line between its neighbours, and whether that is more than noise.

use super::Look;
use super::chosen::Chosen;
use crate::gonio::instrument::Instrument;
use crate::measurement::MaskReason;

/// A gap between two neighbours in θo.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Gap {
    /// Its incidence, by number.
    pub line: usize,
    pub left_deg: f64,
    pub right_deg: f64,
    /// By how much interpolation in its middle is off, in σ of a reading; 0 where noise explains it.
    pub off: f64,
}

impl Gap {
    pub fn width_deg(&self) -> f64 {
        self.right_deg - self.left_deg
    }

    pub fn middle_deg(&self) -> f64 {
        0.5 * (self.left_deg + self.right_deg)
    }
}

/// σ of being off the line from which on noise does not explain it. Both ends of a gap must be: second differences of neighbours have a correlation of
/// −2/3, so noise alone brings 4e-5 of all gaps there.
const SIGNIFICANT: f64 = 3.5;
/// Share of the largest value that counts as σ even where nothing is noisy: means over cones are no better.
const FLOOR: f64 = 1e-6;

/// What tells where readings bend.
pub(super) struct Bends<'a> {
    pub look: &'a Look,
    pub instrument: &'a Instrument,
}

/// A reading of one channel.
#[derive(Clone, Copy)]
struct Node {
    entry: usize,
    theta_deg: f64,
    value: f64,
    /// Of its own, and of where its axes stopped.
    sigma: f64,
}

impl Bends<'_> {
    /// The gaps that may still be halved, incidence by incidence.
    pub fn gaps(&self, chosen: &Chosen, least_step_deg: f64) -> Vec<Gap> {
        let lines = chosen.lines.iter().enumerate();
        let all = lines.flat_map(|(line, entries)| self.of_line(chosen, line, entries));
        all.filter(|gap| gap.width_deg() >= 2.0 * least_step_deg).collect()
    }

    /// Of every channel the largest `off`.
    fn of_line(&self, chosen: &Chosen, line: usize, entries: &[usize]) -> Vec<Gap> {
        let mut offs: Vec<Option<f64>> = vec![None; entries.len().saturating_sub(1)];
        for channel in 0..self.look.table.channels.len() {
            let nodes = self.nodes(chosen, entries, channel);
            let bends: Vec<Option<f64>> = (0..nodes.len()).map(|k| self.bend(&nodes, k, channel)).collect();
            for (k, most) in offs.iter_mut().enumerate() {
                let width = chosen.theta_o_deg[entries[k + 1]] - chosen.theta_o_deg[entries[k]];
                let found = self.off(entries, &nodes, &bends, k).map(|bent| bent * width * width);
                *most = [*most, found].into_iter().flatten().reduce(f64::max);
            }
        }
        let gap = |(k, off): (usize, Option<f64>)| {
            let [left_deg, right_deg] = [entries[k], entries[k + 1]].map(|i| chosen.theta_o_deg[i]);
            Some(Gap { line, left_deg, right_deg, off: off? })
        };
        offs.into_iter().enumerate().filter_map(gap).collect()
    }

    /// By how much interpolation is off in the middle of the gap after reading `k`, in σ of a reading, over its width squared: an eighth of the second
    /// derivative. Between two readings the lesser one counts, for beside a spike the greater one is the spike's. A masked reading ends what can be
    /// interpolated: up to it the curve bends on as it did before, and where it is masked because it saturated, a peak is what is looked for. `None`
    /// where there is nothing to find.
    fn off(&self, entries: &[usize], nodes: &[Option<Node>], bends: &[Option<f64>], k: usize) -> Option<f64> {
        let bend = |at: Option<usize>| at.and_then(|at| bends.get(at).copied().flatten());
        let (valid, masked, before) = match (nodes[k], nodes[k + 1]) {
            (Some(a), Some(b)) => {
                let sigma = (0.5 * (a.sigma.powi(2) + b.sigma.powi(2))).sqrt();
                let least = match (bends[k], bends[k + 1]) {
                    (Some(a), Some(b)) => a.min(b),
                    (a, b) => a.or(b).unwrap_or(0.0),
                };
                return Some(over(least, sigma));
            }
            (Some(a), None) => (a, k + 1, k.checked_sub(1)),
            (None, Some(b)) => (b, k, Some(k + 2)),
            (None, None) => return None,
        };
        if self.look.table.reasons.get(entries[masked]) == Some(&Some(MaskReason::Saturated)) {
            return Some(f64::INFINITY);
        }
        Some(over(bend(before)?, valid.sigma)).filter(|off| *off > 0.0)
    }

    /// The readings of one channel along θo; `None` where one is masked.
    fn nodes(&self, chosen: &Chosen, entries: &[usize], channel: usize) -> Vec<Option<Node>> {
        let table = &self.look.table;
        let sigma = table.sigma_plane(channel);
        let value = |entry: usize| table.value(channel, entry).filter(|v| v.is_finite());
        let floor = FLOOR * entries.iter().filter_map(|&i| value(i)).fold(0.0, |most: f64, v| most.max(v.abs()));
        let node = |&entry: &usize| {
            let own = sigma.map_or(0.0, |plane| plane[entry]).max(floor);
            Some(Node { entry, theta_deg: chosen.theta_o_deg[entry], value: value(entry)?, sigma: own })
        };
        let mut nodes: Vec<Option<Node>> = entries.iter().map(node).collect();
        let jitter = self.instrument.axes.jitter_deg;
        if jitter > 0.0 {
            let slopes: Vec<f64> = (0..nodes.len()).map(|k| slope(&nodes, k)).collect();
            // θi and θo are off, and the angle from the mirror direction by both.
            let wobble = |slope: f64| std::f64::consts::SQRT_2 * slope * jitter;
            let all = nodes.iter_mut().zip(slopes);
            all.for_each(|(node, slope)| node.iter_mut().for_each(|n| n.sigma = n.sigma.hypot(wobble(slope))));
        }
        nodes
    }

    /// The second derivative by θo in degrees, at reading `k`, 0 where noise explains it; `None` where a neighbour is missing.
    fn bend(&self, nodes: &[Option<Node>], k: usize, channel: usize) -> Option<f64> {
        let around = k.checked_sub(1).and_then(|before| nodes.get(before..before + 3))?;
        let three = &[around[0]?, around[1]?, around[2]?];
        let [h, g] = [three[1].theta_deg - three[0].theta_deg, three[2].theta_deg - three[1].theta_deg];
        // What the line between the neighbours says here is their mean by these shares.
        let shares = [-g / (h + g), 1.0, -h / (h + g)];
        let sum = |of: &dyn Fn(&Node) -> f64| shares.iter().zip(three).map(|(s, n)| s * of(n)).sum::<f64>();
        let own: f64 = shares.iter().zip(three).map(|(s, n)| (s * n.sigma).powi(2)).sum();
        let table = &self.look.table;
        // What readings share shifts all three alike and hardly bends them.
        let shared: f64 =
            (0..table.common.len()).map(|c| sum(&|n| table.common_plane(c, channel)[n.entry]).powi(2)).sum();
        let walked = self.drift(&three[1], self.walk(three, shares));
        let off = sum(&|n| n.value);
        let is_significant = off.abs() > SIGNIFICANT * (own + shared + walked).sqrt();
        Some(if is_significant { 2.0 * off.abs() / (h * g) } else { 0.0 })
    }

    /// The variance of a random walk's sum with these shares, which add up to 0, at the times of three readings, in hours.
    fn walk(&self, three: &[Node; 3], shares: [f64; 3]) -> f64 {
        let Some(times) = three.iter().map(|n| self.look.time_s.get(n.entry)).collect::<Option<Vec<&f64>>>() else {
            return 0.0;
        };
        let pair = |a: usize, b: usize| shares[a] * shares[b] * (times[a] - times[b]).abs() / 3600.0;
        // Σ sa sb min(ta, tb) = −½ Σ sa sb |ta − tb| where Σ s = 0.
        -(pair(0, 1) + pair(0, 2) + pair(1, 2))
    }

    /// The variance that drift of source and dark brings to a reading where a walk has that variance.
    fn drift(&self, node: &Node, walk: f64) -> f64 {
        let Instrument { source, detector, .. } = self.instrument;
        let per_rate = 1.0 / (self.instrument.gain() * node.theta_deg.to_radians().cos());
        let [bright, dark] = [node.value * source.drift_per_sqrt_hour, per_rate * detector.dark_drift_per_sqrt_hour];
        walk * (bright * bright + dark * dark)
    }
}

/// An eighth of a second derivative, in σ.
fn over(bend: f64, sigma: f64) -> f64 {
    if bend > 0.0 && sigma > 0.0 { 0.125 * bend / sigma } else { 0.0 }
}

/// The slope at reading `k` by its neighbours, per degree; 0 where there are none.
fn slope(nodes: &[Option<Node>], k: usize) -> f64 {
    let at = |i: Option<usize>| i.and_then(|i| nodes.get(i).copied().flatten());
    let list = [at(k.checked_sub(1)), at(Some(k)), at(Some(k + 1))];
    let mut known = list.into_iter().flatten();
    match (known.next(), known.last()) {
        (Some(a), Some(b)) => (b.value - a.value) / (b.theta_deg - a.theta_deg),
        _ => 0.0,
    }
}
