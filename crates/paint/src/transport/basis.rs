//! The basis: a spanning tree in arrays, its nodes in preorder, so that a subtree is a run of them.
//!
//! Nodes 0 … ns − 1 are sources, the rest targets. A node's flow is that of the arc to its parent; arcs lead from the source to the target
//! whichever of them is the parent. Potentials π hold `w_ij = π_i − π_j` along the tree (u = π of a source, v = −π of a target), so that
//! a pivot shifts the π of one subtree by one number.

use super::start::Cell;

/// One node, its numbers side by side: a walk up the tree touches one place each.
#[derive(Clone, Copy, Debug)]
struct Node {
    parent: u32,
    /// Nodes of its subtree, itself among them.
    size: u32,
    /// Place in the order.
    place: u32,
    /// Of the arc to its parent.
    flow: i64,
}

#[derive(Debug, Default)]
pub(super) struct Basis {
    pub sources: usize,
    nodes: Vec<Node>,
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
        self.nodes.clear();
        self.nodes.resize(n, Node { parent: NONE, size: 1, place: 0, flow: 0 });
        self.order.clear();
        self.stack.clear();
        self.stack.push(root as u32);
        while let Some(x) = self.stack.pop() {
            let at = x as usize;
            self.nodes[at].place = self.order.len() as u32;
            self.order.push(x);
            let parent = self.nodes[at].parent;
            for &(y, flow) in &self.links[self.first[at] as usize..self.first[at + 1] as usize] {
                if y != parent {
                    let node = &mut self.nodes[y as usize];
                    node.parent = x;
                    node.flow = flow;
                    self.stack.push(y);
                }
            }
        }
        for &x in self.order[1..].iter().rev() {
            let Node { parent, size, .. } = self.nodes[x as usize];
            self.nodes[parent as usize].size += size;
        }
    }

    /// Nodes from the root down, parents before children.
    pub fn order(&self) -> &[u32] {
        &self.order
    }

    /// Parent of a node that is not the root.
    pub fn parent(&self, x: usize) -> Option<usize> {
        let parent = self.nodes[x].parent;
        (parent != NONE).then_some(parent as usize)
    }

    /// Flow between a node and its parent.
    pub fn flow(&self, x: usize) -> i64 {
        self.nodes[x].flow
    }

    /// Where the paths of the two ends meet, and the arc that gives out first on the way round.
    fn leaving(&self, i: usize, j: usize) -> (usize, Leaving) {
        let (nodes, sources) = (&self.nodes[..], self.sources);
        let mut best = Leaving { child: i, on_source_side: true, flow: i64::MAX };
        let (mut x, mut y) = (i, j);
        let (mut p, mut q) = (nodes[x], nodes[y]);
        while x != y {
            // the smaller subtree cannot hold the other node
            if p.size < q.size {
                if x < sources && p.flow < best.flow {
                    best = Leaving { child: x, on_source_side: true, flow: p.flow };
                }
                x = p.parent as usize;
                p = nodes[x];
            } else {
                if y >= sources && q.flow < best.flow {
                    best = Leaving { child: y, on_source_side: false, flow: q.flow };
                }
                y = q.parent as usize;
                q = nodes[y];
            }
        }
        (x, best)
    }

    /// Takes the arc from source `i` to target node `j`, of this reduced cost, into the tree and shifts the potentials.
    pub fn pivot(&mut self, i: usize, j: usize, reduced: f64, potentials: &mut [f64]) {
        let (join, leaving) = self.leaving(i, j);
        let step = leaving.flow;
        let (nodes, sources) = (&mut self.nodes[..], self.sources);
        for (end, sign) in [(i, -step), (j, step)] {
            let mut x = end;
            while x != join {
                let node = &mut nodes[x];
                node.flow += if x < sources { sign } else { -sign };
                x = node.parent as usize;
            }
        }
        let (moved, onto) = if leaving.on_source_side { (i, j) } else { (j, i) };
        let by = if leaving.on_source_side { reduced } else { -reduced };
        let (start, length) =
            (self.nodes[leaving.child].place as usize, self.nodes[leaving.child].size as usize);
        Shift { by }.apply(&self.order, start, length, potentials);
        self.hang(leaving.child, moved, onto, join, step);
    }

    /// Cuts the subtree of `cut` off, makes `root` its root and hangs it below `onto`.
    fn hang(&mut self, cut: usize, root: usize, onto: usize, join: usize, step: i64) {
        let (order, nodes, run) = (&mut self.order[..], &mut self.nodes[..], &mut self.run);
        let Node { place: start, size: count, parent: above, .. } = nodes[cut];
        let (start, length) = (start as usize, count as usize);
        // ancestors of both sides below the join
        let mut x = above as usize;
        while x != join {
            nodes[x].size -= count;
            x = nodes[x].parent as usize;
        }
        let end_of_onto = (nodes[onto].place + nodes[onto].size) as usize;
        let mut x = onto;
        while x != join {
            nodes[x].size += count;
            x = nodes[x].parent as usize;
        }
        // preorder, parents, sizes and flows of the subtree seen from its new root
        run.clear();
        let (mut at, mut new_parent, mut new_flow) = (root, onto as u32, step);
        let (mut below_start, mut below_end) = (0, 0);
        loop {
            let old = nodes[at];
            let (first, end) = (old.place as usize, (old.place + old.size) as usize);
            if below_end == 0 {
                run.extend_from_slice(&order[first..end]);
            } else {
                run.extend_from_slice(&order[first..below_start]);
                run.extend_from_slice(&order[below_end..end]);
            }
            let size = count - (below_end - below_start) as u32;
            nodes[at] = Node { parent: new_parent, size, flow: new_flow, place: old.place };
            if at == cut {
                break;
            }
            (below_start, below_end) = (first, end);
            new_parent = at as u32;
            new_flow = old.flow;
            at = old.parent as usize;
        }
        // move the run to behind its new parent, or to the end of that one's subtree, whichever is nearer
        let behind_onto = nodes[onto].place as usize + 1;
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
            nodes[x as usize].place = (first + k) as u32;
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
