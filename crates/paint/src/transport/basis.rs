//! The basis: a spanning tree in arrays, its nodes in preorder, so that a subtree is a run of them.
//!
//! Nodes 0 … ns − 1 are sources, the rest targets. A node's flow is that of the arc to its parent; arcs lead from the source to the target
//! whichever of them is the parent. Potentials π hold `w_ij = π_i − π_j` along the tree (u = π of a source, v = −π of a target), so that
//! a pivot shifts the π of one subtree by one number.

use super::start::Cell;

#[derive(Debug, Default)]
pub(super) struct Basis {
    pub sources: usize,
    pub parent: Vec<u32>,
    pub flow: Vec<i64>,
    size: Vec<u32>,
    place: Vec<u32>,
    order: Vec<u32>,
    run: Vec<u32>,
    // adjacency of the first tree
    first: Vec<u32>,
    links: Vec<(u32, i64)>,
    stack: Vec<u32>,
}

/// The arc that leaves the tree on a pivot.
struct Leaving {
    child: usize,
    on_source_side: bool,
    flow: i64,
}

/// A run of the preorder whose potentials are to be shifted.
pub(super) struct Shift {
    pub by: f64,
}

const NONE: u32 = u32::MAX;

impl Basis {
    /// Takes up a spanning tree; the root is the node with the most arcs.
    pub fn plant(&mut self, sources: usize, targets: usize, cells: &[Cell]) {
        let n = sources + targets;
        self.sources = sources;
        self.first.clear();
        self.first.resize(n + 1, 0);
        for c in cells {
            self.first[c.row as usize] += 1;
            self.first[sources + c.column as usize] += 1;
        }
        let root = (0..n).max_by_key(|&x| self.first[x]).unwrap_or(0);
        let mut sum = 0;
        for f in &mut self.first {
            sum += *f;
            *f = sum;
        }
        self.links.clear();
        self.links.resize(2 * cells.len(), (0, 0));
        for c in cells {
            let (i, j) = (c.row as usize, sources + c.column as usize);
            for (x, y) in [(i, j), (j, i)] {
                self.first[x] -= 1;
                self.links[self.first[x] as usize] = (y as u32, c.flow);
            }
        }
        for (array, value) in [(&mut self.parent, NONE), (&mut self.size, 1), (&mut self.place, 0)] {
            array.clear();
            array.resize(n, value);
        }
        self.flow.clear();
        self.flow.resize(n, 0);
        self.order.clear();
        self.stack.clear();
        self.stack.push(root as u32);
        while let Some(x) = self.stack.pop() {
            self.place[x as usize] = self.order.len() as u32;
            self.order.push(x);
            let links = self.first[x as usize] as usize..self.first[x as usize + 1] as usize;
            for &(y, flow) in &self.links[links] {
                if y != self.parent[x as usize] {
                    self.parent[y as usize] = x;
                    self.flow[y as usize] = flow;
                    self.stack.push(y);
                }
            }
        }
        for &x in self.order[1..].iter().rev() {
            let up = self.parent[x as usize] as usize;
            self.size[up] += self.size[x as usize];
        }
    }

    /// Nodes from the root down, parents before children.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Parent of a node that is not the root.
    pub fn parent(&self, x: usize) -> Option<usize> {
        (self.parent[x] != NONE).then(|| self.parent[x] as usize)
    }

    /// Where the paths of the two ends meet, and the arc that gives out first on the way round.
    fn leaving(&self, i: usize, j: usize) -> (usize, Leaving) {
        let (size, flow, parent) = (&self.size[..], &self.flow[..], &self.parent[..]);
        let mut best = Leaving { child: i, on_source_side: true, flow: i64::MAX };
        let (mut x, mut y) = (i, j);
        while x != y {
            // the smaller subtree cannot hold the other node
            if size[x] < size[y] {
                if x < self.sources && flow[x] < best.flow {
                    best = Leaving { child: x, on_source_side: true, flow: flow[x] };
                }
                x = parent[x] as usize;
            } else {
                if y >= self.sources && flow[y] < best.flow {
                    best = Leaving { child: y, on_source_side: false, flow: flow[y] };
                }
                y = parent[y] as usize;
            }
        }
        (x, best)
    }

    /// Takes the arc from source `i` to target node `j` into the tree. The moved nodes' potentials are to be shifted by what comes
    /// back, through [`Basis::shift`].
    pub fn pivot(&mut self, i: usize, j: usize, reduced: f64, potentials: &mut [f64]) {
        let (join, leaving) = self.leaving(i, j);
        let step = leaving.flow;
        let (flow, parent) = (&mut self.flow[..], &self.parent[..]);
        let mut x = i;
        while x != join {
            flow[x] += if x < self.sources { -step } else { step };
            x = parent[x] as usize;
        }
        let mut y = j;
        while y != join {
            flow[y] += if y < self.sources { step } else { -step };
            y = parent[y] as usize;
        }
        let (moved, onto) = if leaving.on_source_side { (i, j) } else { (j, i) };
        let by = if leaving.on_source_side { reduced } else { -reduced };
        let (start, length) = (self.place[leaving.child] as usize, self.size[leaving.child] as usize);
        Shift { by }.apply(&self.order, start, length, potentials);
        self.hang(leaving.child, moved, onto, join, step);
    }

    /// Cuts the subtree of `cut` off, makes `root` its root and hangs it below `onto`.
    fn hang(&mut self, cut: usize, root: usize, onto: usize, join: usize, step: i64) {
        let (order, place, size, parent, flow) = (
            &mut self.order[..],
            &mut self.place[..],
            &mut self.size[..],
            &mut self.parent[..],
            &mut self.flow[..],
        );
        let start = place[cut] as usize;
        let count = size[cut];
        let length = count as usize;
        // ancestors of both sides below the join
        let mut x = parent[cut] as usize;
        while x != join {
            size[x] -= count;
            x = parent[x] as usize;
        }
        let end_of_onto = place[onto] as usize + size[onto] as usize;
        let mut x = onto;
        while x != join {
            size[x] += count;
            x = parent[x] as usize;
        }
        // preorder, parents, sizes and flows of the subtree seen from its new root
        let run = &mut self.run;
        run.clear();
        let (mut node, mut new_parent, mut new_flow) = (root, onto as u32, step);
        let (mut below_start, mut below_end) = (0, 0);
        loop {
            let at = place[node] as usize;
            let end = at + size[node] as usize;
            if below_end == 0 {
                run.extend_from_slice(&order[at..end]);
            } else {
                run.extend_from_slice(&order[at..below_start]);
                run.extend_from_slice(&order[below_end..end]);
            }
            let (old_parent, old_flow) = (parent[node], flow[node]);
            parent[node] = new_parent;
            flow[node] = new_flow;
            size[node] = count - (below_end - below_start) as u32;
            if node == cut {
                break;
            }
            (below_start, below_end) = (at, end);
            new_parent = node as u32;
            new_flow = old_flow;
            node = old_parent as usize;
        }
        // move the run to behind its new parent, or to the end of that one's subtree, whichever is nearer
        let behind_onto = place[onto] as usize + 1;
        let (to, changed) = if start >= behind_onto {
            let to = if end_of_onto <= start { end_of_onto } else { behind_onto };
            order.copy_within(to..start, to + length);
            (to, to..start + length)
        } else {
            order.copy_within(start + length..behind_onto, start);
            (behind_onto - length, start..behind_onto)
        };
        order[to..to + length].copy_from_slice(run);
        let first = changed.start;
        for (k, &x) in order[changed].iter().enumerate() {
            place[x as usize] = (first + k) as u32;
        }
    }
}

impl Shift {
    /// Only differences of potentials matter: the smaller part of the tree is shifted, the other way where it is the rest.
    fn apply(&self, order: &[u32], start: usize, length: usize, potentials: &mut [f64]) {
        if 2 * length <= order.len() {
            for &x in &order[start..start + length] {
                potentials[x as usize] += self.by;
            }
        } else {
            for &x in order[..start].iter().chain(&order[start + length..]) {
                potentials[x as usize] -= self.by;
            }
        }
    }
}
