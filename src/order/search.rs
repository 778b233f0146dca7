//! The depth-first search that turns relations into an order.
//!
//! Tarjan 1972, "Depth-first search and linear graph algorithms": along edges from each tetrahedron to
//! those in front of it, strongly connected components come out after all that they reach, that is,
//! front to back; a component of more than one tetrahedron is a cycle of visibility. The search keeps its own
//! stack (a chain of relations may be as long as the shell has tetrahedra) and visits roots and edges
//! by ascending id, so that equal relations give equal orders.

use std::ops::Range;

/// For each tetrahedron, those directly in front of it: compressed rows, ascending, without duplicates.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct InFront {
    /// Row `v` is `front[start[v]..start[v + 1]]`.
    start: Vec<u32>,
    front: Vec<u32>,
}

impl InFront {
    /// Gathers lists of `[front, back]` pairs of ids below `tetrahedra`; their order does not matter.
    pub fn new(tetrahedra: usize, lists: &[&[[u32; 2]]]) -> Self {
        let pairs = || lists.iter().flat_map(|list| list.iter());
        let mut end = vec![0u32; tetrahedra + 1];
        for &[_, back] in pairs() {
            end[back as usize + 1] += 1;
        }
        for v in 0..tetrahedra {
            end[v + 1] += end[v];
        }
        let rows = end.clone();
        let mut front = vec![0u32; rows[tetrahedra] as usize];
        for &[ahead, back] in pairs() {
            let slot = &mut end[back as usize];
            front[*slot as usize] = ahead;
            *slot += 1;
        }

        let mut start = Vec::with_capacity(tetrahedra + 1);
        let mut kept = 0;
        for v in 0..tetrahedra {
            start.push(kept as u32);
            let row = rows[v] as usize..rows[v + 1] as usize;
            front[row.clone()].sort_unstable();
            let row_start = kept;
            for i in row {
                if kept == row_start || front[kept - 1] != front[i] {
                    front[kept] = front[i];
                    kept += 1;
                }
            }
        }
        start.push(kept as u32);
        front.truncate(kept);
        Self { start, front }
    }

    /// The number of different relations.
    pub fn relations(&self) -> usize {
        self.front.len()
    }

    /// All tetrahedra front to back, and the ranges of that sequence that are cycles.
    pub fn components(&self) -> (Vec<u32>, Vec<Range<usize>>) {
        /// Not reached yet.
        const UNSEEN: u32 = u32::MAX;
        /// In the sequence; as a visit number, later than any, so that a minimum ignores it.
        const EMITTED: u32 = u32::MAX - 1;

        let count = self.start.len() - 1;
        let mut visit = vec![UNSEEN; count];
        let mut lowest = vec![0u32; count];
        let mut next_edge = self.start[..count].to_vec();
        let mut visits = 0;
        let mut path = Vec::new();
        let mut open = Vec::new();
        let mut sequence = Vec::with_capacity(count);
        let mut cycles = Vec::new();

        for root in 0..count {
            if visit[root] != UNSEEN {
                continue;
            }
            let mut entered = Some(root);
            loop {
                if let Some(v) = entered.take() {
                    visit[v] = visits;
                    lowest[v] = visits;
                    visits += 1;
                    path.push(v);
                    open.push(v as u32);
                }
                let Some(&v) = path.last() else { break };
                if next_edge[v] < self.start[v + 1] {
                    let ahead = self.front[next_edge[v] as usize] as usize;
                    next_edge[v] += 1;
                    if visit[ahead] == UNSEEN {
                        entered = Some(ahead);
                    } else {
                        lowest[v] = lowest[v].min(visit[ahead]);
                    }
                    continue;
                }
                path.pop();
                if let Some(&parent) = path.last() {
                    lowest[parent] = lowest[parent].min(lowest[v]);
                }
                if lowest[v] == visit[v] {
                    let begin = sequence.len();
                    loop {
                        let member = open.pop().expect("a component's first visit is still open");
                        visit[member as usize] = EMITTED;
                        sequence.push(member);
                        if member as usize == v {
                            break;
                        }
                    }
                    if sequence.len() > begin + 1 {
                        cycles.push(begin..sequence.len());
                    }
                }
            }
        }
        (sequence, cycles)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_hold_each_relation_once_in_ascending_order() {
        let graph = InFront::new(3, &[&[[2, 0], [1, 0]], &[[1, 0], [2, 1]]]);
        assert_eq!(graph, InFront { start: vec![0, 2, 3, 3], front: vec![1, 2, 2] });
        assert_eq!(graph.relations(), 3);
        assert_eq!(graph.components(), (vec![2, 1, 0], vec![]));
        assert_eq!(InFront::new(0, &[]).components(), (vec![], vec![]));
    }

    #[test]
    fn a_chain_of_a_million_needs_no_deep_stack() {
        let count = 1_000_000;
        let chain: Vec<[u32; 2]> = (1..count).map(|id| [id, id - 1]).collect();
        let (sequence, cycles) = InFront::new(count as usize, &[&chain]).components();
        assert!(sequence.into_iter().eq((0..count).rev()));
        assert!(cycles.is_empty());
    }

    #[test]
    fn cycles_are_exactly_the_components_of_more_than_one() {
        // 0 is in front of the cycle 1 2 3, which is in front of 4; 5 and 6 are a cycle apart.
        let pairs = [[0, 1], [1, 2], [2, 3], [3, 1], [3, 4], [5, 6], [6, 5]];
        let (sequence, cycles) = InFront::new(7, &[&pairs]).components();
        assert_eq!(cycles, [1..4, 5..7]);
        assert_eq!((sequence[0], sequence[4]), (0, 4));
        let mut members = sequence[1..4].to_vec();
        members.sort_unstable();
        assert_eq!(members, [1, 2, 3]);
    }
}
