//! Which pairing of two equal sets costs least?

use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// Arcs of a row in the first round: its cheapest columns. Enough for nearly all rows of two samples
/// of one distribution; the others get more when they turn out to need them.
const NEAREST: usize = 24;

const NONE: usize = usize::MAX;

/// The assignment `row -> column` of least total cost of a square matrix (row-major, finite).
///
/// Shortest augmenting paths (R. Jonker and A. Volgenant, Computing 38, 325-340, 1987) over each row's
/// cheapest columns only; then the prices found are held against the whole matrix, and rows for which
/// another column would be cheaper get it as an arc and are assigned anew (A. Volgenant, "Linear and
/// semi-assignment problems: a core oriented approach", Computers & OR 23, 917-932, 1996). Ends when no row has
/// one, which proves that the assignment is the least of all.
///
/// # Panics
/// If `costs` is not `n x n`.
pub fn least_cost(costs: &[f32], n: usize) -> Vec<usize> {
    assert_eq!(costs.len(), n * n);
    let mut core = Core::new(costs, n);
    let mut free: Vec<usize> = (0..n).filter(|i| core.column_of[*i] == NONE).collect();
    free = core.outbid(free);
    free = core.outbid(free);
    while !free.is_empty() {
        for &row in &free {
            core.assign(row);
        }
        free = core.unhappy();
    }
    core.column_of
}

/// The part of the matrix that has been looked at, and the assignment so far.
struct Core<'a> {
    costs: &'a [f32],
    n: usize,
    arcs: Vec<Vec<(u32, f32)>>,
    column_of: Vec<usize>,
    row_of: Vec<usize>,
    price: Vec<f32>,
    search: Search,
}

/// What one search for a path needs.
struct Search {
    distance: Vec<f32>,
    from: Vec<u32>,
    /// In which search a column was last reached, and in which it was done.
    reached: Vec<u32>,
    closed: Vec<u32>,
    number: u32,
    heap: BinaryHeap<Reverse<(Ordered, u32)>>,
    done: Vec<(usize, f32)>,
}

/// A cost that can stand in a heap.
#[derive(Clone, Copy, PartialEq)]
struct Ordered(f32);

impl Eq for Ordered {}

impl PartialOrd for Ordered {
    fn partial_cmp(&self, other: &Self) -> Option<std::cmp::Ordering> {
        Some(self.cmp(other))
    }
}

impl Ord for Ordered {
    fn cmp(&self, other: &Self) -> std::cmp::Ordering {
        self.0.total_cmp(&other.0)
    }
}

impl<'a> Core<'a> {
    /// Each column goes to its cheapest row, if that is still free.
    fn new(costs: &'a [f32], n: usize) -> Self {
        let row = |i: usize| &costs[i * n..(i + 1) * n];
        let mut price = row(0).to_vec();
        let mut cheapest = vec![0usize; n];
        // Row by row, as the matrix lies in memory.
        for i in 1..n {
            for ((c, p), best) in row(i).iter().zip(&mut price).zip(&mut cheapest) {
                if c < p {
                    *p = *c;
                    *best = i;
                }
            }
        }
        let mut core = Self {
            costs,
            n,
            arcs: (0..n).map(|i| nearest(row(i))).collect(),
            column_of: vec![NONE; n],
            row_of: vec![NONE; n],
            price,
            search: Search {
                distance: vec![0.0; n],
                from: vec![0; n],
                reached: vec![0; n],
                closed: vec![0; n],
                number: 0,
                heap: BinaryHeap::new(),
                done: Vec::new(),
            },
        };
        for j in (0..n).rev() {
            let i = cheapest[j];
            if core.column_of[i] == NONE {
                core.column_of[i] = j;
                core.row_of[j] = i;
                core.add_arc(i, j);
            }
        }
        core
    }

    fn row(&self, i: usize) -> &'a [f32] {
        &self.costs[i * self.n..(i + 1) * self.n]
    }

    fn add_arc(&mut self, i: usize, j: usize) {
        let arcs = &mut self.arcs[i];
        if !arcs.iter().any(|(column, _)| *column as usize == j) {
            arcs.push((j as u32, self.costs[i * self.n + j]));
        }
    }

    /// Each free row takes its cheapest column and outbids the second; returns the rows still free.
    fn outbid(&mut self, mut free: Vec<usize>) -> Vec<usize> {
        let mut still = Vec::new();
        let mut budget = 4 * self.n;
        let mut k = 0;
        while k < free.len() {
            let i = free[k];
            k += 1;
            let (mut best, mut first, mut second) = (NONE, f32::INFINITY, f32::INFINITY);
            for &(j, cost) in &self.arcs[i] {
                let value = cost - self.price[j as usize];
                if value < first {
                    (second, first, best) = (first, value, j as usize);
                } else if value < second {
                    second = value;
                }
            }
            let previous = self.row_of[best];
            let outbids = first < second && second.is_finite();
            if outbids {
                self.price[best] -= second - first;
            } else if previous != NONE {
                still.push(i);
                continue;
            }
            self.column_of[i] = best;
            self.row_of[best] = i;
            if previous != NONE {
                self.column_of[previous] = NONE;
                if outbids && budget > 0 {
                    budget -= 1;
                    k -= 1;
                    free[k] = previous;
                } else {
                    still.push(previous);
                }
            }
        }
        still
    }

    /// Assigns a free row along the cheapest path to a free column.
    fn assign(&mut self, start: usize) {
        let (end, shortest) = match self.path(start) {
            Some(found) => found,
            None => {
                // Its arcs lead to no free column: from now on it has all.
                let all = self.row(start).iter().enumerate();
                self.arcs[start] = all.map(|(j, cost)| (j as u32, *cost)).collect();
                self.path(start).expect("an arc to every column")
            }
        };
        for &(j, so_far) in &self.search.done {
            self.price[j] += so_far - shortest;
        }
        let mut j = end;
        loop {
            let i = self.search.from[j] as usize;
            self.row_of[j] = i;
            let next = self.column_of[i];
            self.column_of[i] = j;
            if i == start {
                break;
            }
            j = next;
        }
    }

    /// E. W. Dijkstra's search; the free column found and the length of the way there.
    fn path(&mut self, start: usize) -> Option<(usize, f32)> {
        let s = &mut self.search;
        s.number += 1;
        s.heap.clear();
        s.done.clear();
        let (mut i, mut base) = (start, 0.0);
        loop {
            for &(j, cost) in &self.arcs[i] {
                let column = j as usize;
                let way = base + (cost - self.price[column]);
                let is_new = s.reached[column] != s.number;
                if s.closed[column] != s.number && (is_new || way < s.distance[column]) {
                    s.reached[column] = s.number;
                    s.distance[column] = way;
                    s.from[column] = i as u32;
                    s.heap.push(Reverse((Ordered(way), j)));
                }
            }
            let (way, column) = loop {
                let Reverse((Ordered(way), j)) = s.heap.pop()?;
                if s.closed[j as usize] != s.number {
                    break (way, j as usize);
                }
            };
            s.closed[column] = s.number;
            let owner = self.row_of[column];
            if owner == NONE {
                return Some((column, way));
            }
            s.done.push((column, way));
            i = owner;
            base = way - (self.costs[i * self.n + column] - self.price[column]);
        }
    }

    /// Rows for which a column without an arc is cheaper than their own: they get the arcs and are free.
    fn unhappy(&mut self) -> Vec<usize> {
        let mut free = Vec::new();
        for i in 0..self.n {
            let (row, own) = (self.row(i), self.column_of[i]);
            let pays = row[own] - self.price[own];
            // Rounding of f32, not a better column.
            let limit = pays - 1e-6 * (row[own].abs() + self.price[own].abs() + 1e-3);
            if row.iter().zip(&self.price).all(|(c, p)| c - p >= limit) {
                continue;
            }
            let before = self.arcs[i].len();
            let cheaper = |(c, p): (&f32, &f32)| c - p < limit;
            let new: Vec<bool> = row.iter().zip(&self.price).map(cheaper).collect();
            for (j, _) in new.iter().enumerate().filter(|(_, is_new)| **is_new) {
                self.add_arc(i, j);
            }
            if self.arcs[i].len() > before {
                self.column_of[i] = NONE;
                self.row_of[own] = NONE;
                free.push(i);
            }
        }
        free
    }
}

/// The cheapest columns of a row.
fn nearest(row: &[f32]) -> Vec<(u32, f32)> {
    let mut all: Vec<(u32, f32)> = (0u32..).zip(row.iter().copied()).collect();
    if all.len() > NEAREST {
        all.select_nth_unstable_by(NEAREST, |a, b| a.1.total_cmp(&b.1).then(a.0.cmp(&b.0)));
        all.truncate(NEAREST);
        all.shrink_to_fit();
    }
    all
}

#[cfg(test)]
mod tests {
    use super::*;

    fn total(costs: &[f32], n: usize, assignment: &[usize]) -> f64 {
        let mut seen = vec![false; n];
        let mut sum = 0.0;
        for (i, j) in assignment.iter().enumerate() {
            assert!(!seen[*j], "each column once");
            seen[*j] = true;
            sum += f64::from(costs[i * n + j]);
        }
        sum
    }

    /// The least of all 720 permutations.
    fn by_trying_all(costs: &[f32], n: usize) -> f64 {
        fn go(costs: &[f32], n: usize, i: usize, used: u32) -> f64 {
            if i == n {
                return 0.0;
            }
            (0..n)
                .filter(|j| used >> j & 1 == 0)
                .map(|j| f64::from(costs[i * n + j]) + go(costs, n, i + 1, used | 1 << j))
                .fold(f64::MAX, f64::min)
        }
        go(costs, n, 0, 0)
    }

    #[test]
    fn the_cost_is_the_least_of_all_permutations() {
        let mut state = 7u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            // Coarse numbers, so that ties are frequent.
            (state >> 28) as f32
        };
        for n in 1..=6 {
            for _ in 0..200 {
                let costs: Vec<f32> = (0..n * n).map(|_| next()).collect();
                let found = total(&costs, n, &least_cost(&costs, n));
                assert!((found - by_trying_all(&costs, n)).abs() < 1e-4, "{costs:?}");
            }
        }
    }

    /// The Hungarian method, plain: every column looked at in every step.
    fn by_hungarian(costs: &[f32], n: usize) -> f64 {
        let cost = |i: usize, j: usize| f64::from(costs[(i - 1) * n + j - 1]);
        let (mut u, mut v) = (vec![0.0; n + 1], vec![0.0; n + 1]);
        let (mut row_of, mut way) = (vec![0; n + 1], vec![0; n + 1]);
        for i in 1..=n {
            row_of[0] = i;
            let mut j0 = 0;
            let mut least = vec![f64::MAX; n + 1];
            let mut used = vec![false; n + 1];
            while row_of[j0] != 0 {
                used[j0] = true;
                let i0 = row_of[j0];
                let (mut delta, mut j1) = (f64::MAX, 0);
                for j in (1..=n).filter(|j| !used[*j]) {
                    let reduced = cost(i0, j) - u[i0] - v[j];
                    if reduced < least[j] {
                        (least[j], way[j]) = (reduced, j0);
                    }
                    if least[j] < delta {
                        (delta, j1) = (least[j], j);
                    }
                }
                for j in 0..=n {
                    if used[j] {
                        u[row_of[j]] += delta;
                        v[j] -= delta;
                    } else {
                        least[j] -= delta;
                    }
                }
                j0 = j1;
            }
            while j0 != 0 {
                row_of[j0] = row_of[way[j0]];
                j0 = way[j0];
            }
        }
        (1..=n).map(|j| cost(row_of[j], j)).sum()
    }

    #[test]
    fn looking_at_few_columns_first_misses_nothing() {
        let mut state = 3u32;
        let mut next = || {
            state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            (state >> 8) as f32 / (1 << 24) as f32
        };
        for round in 0..12 {
            let n = 150;
            // Two clusters of unequal size: many rows must leave their nearest columns.
            let mut points = |share: f32| -> Vec<[f32; 2]> {
                (0..n)
                    .map(|i| {
                        let far = if (i as f32) < share * n as f32 {
                            3.0
                        } else {
                            0.0
                        };
                        [next() + far, next()]
                    })
                    .collect()
            };
            let (a, b) = (points(0.2), points(0.05 * round as f32));
            let distance = |p: &[f32; 2], q: &[f32; 2]| (p[0] - q[0]).hypot(p[1] - q[1]);
            let costs: Vec<f32> = a
                .iter()
                .flat_map(|p| b.iter().map(move |q| distance(p, q)))
                .collect();
            let found = total(&costs, n, &least_cost(&costs, n));
            let least = by_hungarian(&costs, n);
            assert!((found - least).abs() < 1e-4 * least, "{found} {least}");
        }
    }

    #[test]
    fn points_on_a_line_are_paired_in_their_order() {
        let n = 300;
        let a: Vec<f32> = (0..n).map(|i| ((i * 7919) % n) as f32).collect();
        let b: Vec<f32> = (0..n).map(|i| ((i * 104_729) % n) as f32 + 0.25).collect();
        let costs: Vec<f32> = a
            .iter()
            .flat_map(|x| b.iter().map(move |y| (x - y).abs()))
            .collect();
        let sum = total(&costs, n, &least_cost(&costs, n));
        assert!((sum - 0.25 * n as f64).abs() < 1e-2, "{sum}");
    }
}
