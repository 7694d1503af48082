//! A hierarchy whose nodes have eight children, so that one step asks eight boxes on the vector units: made from a binary one.

use obvhs::bvh2::Bvh2;
use obvhs::bvh2::node::Bvh2Node;

use crate::numeric::simd::{Kernel, Simd, vectorised};

/// Children of a node.
const WIDTH: usize = 8;
type Eight = [f32; WIDTH];

/// A bit for each of them, told like this so that they are asked side by side.
const BITS: [u32; WIDTH] = [1, 2, 4, 8, 16, 32, 64, 128];

/// Marks a child that is a leaf; the rest is its number.
const LEAF: u32 = 1 << 31;

/// Places to come back to that need no memory of their own.
const USUAL_ROOM: usize = 64;

/// Boxes side by side.
#[derive(Debug, Clone)]
#[repr(align(64))]
struct Node {
    /// By axis the lower and the upper ends; from ∞ to −∞ where there is no child.
    bounds: [[Eight; 2]; 3],
    children: [u32; WIDTH],
}

/// A ray in the tree's coordinates, from 0 to `t_max`.
#[derive(Debug, Clone, Copy)]
pub(super) struct WideRay {
    pub origin: [f32; 3],
    pub inverse: [f32; 3],
    pub t_max: f32,
}

/// What lies in the leaves.
pub(super) trait Leaves {
    /// Asks a leaf; where it has something before what was met so far, the new end of the ray.
    fn meet(&mut self, leaf: usize) -> Option<f32>;
}

/// The hierarchy.
#[derive(Debug)]
pub(super) struct Wide {
    nodes: Vec<Node>,
    /// First primitive and number of primitives of each leaf.
    leaves: Vec<(u32, u32)>,
    /// Places that a walk may have to come back to.
    room: usize,
}

impl Wide {
    /// From a binary hierarchy that is not empty.
    pub fn new(tree: &Bvh2) -> Self {
        let mut wide = Self { nodes: Vec::new(), leaves: Vec::new(), room: 0 };
        // Nodes to be made: their children before they are opened, the place that asks for their number, how many steps down they are.
        let mut waiting = vec![(vec![&tree.nodes[0]], None, 1)];
        while let Some((from, asks, depth)) = waiting.pop() {
            let number = wide.nodes.len();
            if let Some((parent, k)) = asks {
                let parent: &mut Node = &mut wide.nodes[parent];
                parent.children[k] = number as u32;
            }
            // A step down leaves seven children to come back to.
            wide.room = wide.room.max(depth * (WIDTH - 1) + 1);
            let children = opened(tree, from);
            let node = wide.node(&children);
            wide.nodes.push(node);
            let inner = children.iter().enumerate().filter(|(_, child)| !child.is_leaf());
            waiting.extend(inner.map(|(k, child)| (halves(tree, child).to_vec(), Some((number, k)), depth + 1)));
        }
        wide
    }

    /// First primitive and number of primitives of each leaf.
    pub fn leaves(&self) -> &[(u32, u32)] {
        &self.leaves
    }

    /// A node with these children, of which only leaves are numbered yet.
    fn node(&mut self, children: &[&Bvh2Node]) -> Node {
        let (none, all) = ([f32::INFINITY; WIDTH], [f32::NEG_INFINITY; WIDTH]);
        let mut node = Node { bounds: [[none, all]; 3], children: [LEAF; WIDTH] };
        for (k, child) in children.iter().enumerate() {
            let (low, high) = (child.aabb().min.to_array(), child.aabb().max.to_array());
            for axis in 0..3 {
                node.bounds[axis][0][k] = low[axis];
                node.bounds[axis][1][k] = high[axis];
            }
            if child.is_leaf() {
                node.children[k] = LEAF | self.leaves.len() as u32;
                self.leaves.push((child.first_index, child.prim_count));
            }
        }
        node
    }

    /// Asks the leaves whose boxes the ray meets, near ones first; with `ANY` until one has something.
    pub fn walk<const ANY: bool>(&self, ray: WideRay, leaves: &mut impl Leaves) {
        vectorised(Walk::<_, ANY> { tree: self, ray, leaves });
    }
}

fn halves<'a>(tree: &'a Bvh2, node: &Bvh2Node) -> [&'a Bvh2Node; 2] {
    let first = node.first_index as usize;
    [&tree.nodes[first], &tree.nodes[first + 1]]
}

/// The nodes, the largest opened again and again while there is room.
fn opened<'a>(tree: &'a Bvh2, mut list: Vec<&'a Bvh2Node>) -> Vec<&'a Bvh2Node> {
    while list.len() < WIDTH {
        let area = |node: &Bvh2Node| node.aabb().half_area();
        let inner = list.iter().enumerate().filter(|(_, node)| !node.is_leaf());
        let Some((largest, _)) = inner.max_by(|a, b| area(a.1).total_cmp(&area(b.1))) else { break };
        let node = list.swap_remove(largest);
        list.extend(halves(tree, node));
    }
    list
}

/// A place to come back to, and where the ray enters it.
#[derive(Debug, Clone, Copy, Default)]
struct Later {
    child: u32,
    near: f32,
}

struct Walk<'a, L, const ANY: bool> {
    tree: &'a Wide,
    ray: WideRay,
    leaves: &'a mut L,
}

impl<L: Leaves, const ANY: bool> Kernel for Walk<'_, L, ANY> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, _: S) {
        if self.tree.room <= USUAL_ROOM {
            self.go(&mut [Later::default(); USUAL_ROOM]);
        } else {
            let mut places = vec![Later::default(); self.tree.room];
            self.go(&mut places);
        }
    }
}

impl<L: Leaves, const ANY: bool> Walk<'_, L, ANY> {
    #[inline(always)]
    fn go(mut self, later: &mut [Later]) {
        let mut count = 0;
        let mut child = 0;
        loop {
            if child & LEAF == 0 {
                let node = &self.tree.nodes[child as usize];
                let (mut met, near) = node.met(&self.ray);
                let first = count;
                while met != 0 {
                    let k = met.trailing_zeros() as usize;
                    met &= met - 1;
                    let mut place = count;
                    // The nearest last: it comes next.
                    while !ANY && place > first && later[place - 1].near < near[k] {
                        later[place] = later[place - 1];
                        place -= 1;
                    }
                    later[place] = Later { child: node.children[k], near: near[k] };
                    count += 1;
                }
            } else if let Some(t_max) = self.leaves.meet((child & !LEAF) as usize) {
                if ANY {
                    return;
                }
                self.ray.t_max = t_max;
            }
            loop {
                if count == 0 {
                    return;
                }
                count -= 1;
                if later[count].near <= self.ray.t_max {
                    break;
                }
            }
            child = later[count].child;
        }
    }
}

impl Node {
    /// Which children's boxes the ray meets, as bits, and where it enters them.
    #[inline(always)]
    fn met(&self, ray: &WideRay) -> (u32, Eight) {
        let (mut near, mut far) = ([0.0; WIDTH], [ray.t_max; WIDTH]);
        for axis in 0..3 {
            let (origin, inverse) = (ray.origin[axis], ray.inverse[axis]);
            let backward = usize::from(inverse < 0.0);
            let (enter, leave) = (&self.bounds[axis][backward], &self.bounds[axis][1 - backward]);
            for k in 0..WIDTH {
                let (a, b) = ((enter[k] - origin) * inverse, (leave[k] - origin) * inverse);
                near[k] = if a > near[k] { a } else { near[k] };
                far[k] = if b < far[k] { b } else { far[k] };
            }
        }
        let mut bits = [0; WIDTH];
        for k in 0..WIDTH {
            bits[k] = if near[k] <= far[k] { BITS[k] } else { 0 };
        }
        (bits.iter().fold(0, |all, bit| all | bit), near)
    }
}
