#![allow(warnings)]
#[path = "../tests/instrument/experiment.rs"]
mod experiment;
use experiment::*;
fn main() {
    let a: Vec<String> = std::env::args().collect();
    let class = CLASSES.iter().find(|c| c.0 == a[2]).unwrap().1;
    let of = Experiment::new(&a[1], class);
    for s in 0..a[3].parse().unwrap() {
        let m = of.reduced(s).measurement;
        let held: usize = (0..m.len())
            .filter(|i| m.value(0, *i).is_some_and(|v| (v - of.expected(*i)).abs() <= 1.96 * sigma(&m, *i)))
            .count();
        let peak = (0..m.len()).filter_map(|i| m.value(0, i)).fold(0., f64::max);
        println!(
            "{s} held {held} value {:?} sigma {:.2} exp {:.2} largest {:.1} common {} {:?}",
            m.value(0, 0),
            sigma(&m, 0),
            of.expected(0),
            peak,
            m.common.len(),
            m.notes
        );
    }
}
