//! Cycles in a graph some of whose nodes are ancestors of others.

use std::collections::{BTreeMap, BTreeSet};

/// From → to.
pub(super) type Edges = BTreeMap<usize, BTreeSet<usize>>;

/// The maximal sets of nodes that all reach each other along `edges`, ascending, in which some cycle has no node that
/// is an ancestor of all its others. `is_above(a, b)`: a is an ancestor of b.
pub(super) fn circles(edges: &Edges, is_above: &impl Fn(usize, usize) -> bool) -> Vec<BTreeSet<usize>> {
    let nodes: BTreeSet<usize> = edges.iter().flat_map(|(from, to)| to.iter().chain([from]).copied()).collect();
    within(edges, &nodes, is_above)
}

fn within(edges: &Edges, nodes: &BTreeSet<usize>, is_above: &impl Fn(usize, usize) -> bool) -> Vec<BTreeSet<usize>> {
    let reached: BTreeMap<usize, BTreeSet<usize>> = nodes.iter().map(|&node| (node, reach(edges, nodes, node))).collect();
    let mut left = nodes.clone();
    let mut found = Vec::new();
    while let Some(node) = left.pop_first() {
        let mut knot: BTreeSet<usize> = reached[&node].iter().copied().filter(|other| reached[other].contains(&node)).collect();
        knot.insert(node);
        left = left.difference(&knot).copied().collect();
        if knot.len() == 1 {
            continue;
        }
        // Two cycles through one node have roots that are both its ancestors, so one is above the other: a component of
        // permitted cycles alone has one root. Without it, the remainder is searched again.
        match knot.iter().copied().find(|&root| knot.iter().all(|&other| other == root || is_above(root, other))) {
            Some(root) => {
                knot.remove(&root);
                found.extend(within(edges, &knot, is_above));
            }
            None => found.push(knot),
        }
    }
    found
}

/// Nodes reachable from a node along at least one of `edges` without leaving `nodes`.
fn reach(edges: &Edges, nodes: &BTreeSet<usize>, from: usize) -> BTreeSet<usize> {
    let mut reached = BTreeSet::new();
    let mut next = vec![from];
    while let Some(node) = next.pop() {
        for &to in edges.get(&node).into_iter().flatten() {
            if nodes.contains(&to) && reached.insert(to) {
                next.push(to);
            }
        }
    }
    reached
}
