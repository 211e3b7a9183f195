//! Which pairing of two equal sets costs least?

/// The assignment `row -> column` of least total cost of a square matrix (row-major, finite), by
/// shortest augmenting paths.
///
/// R. Jonker and A. Volgenant, Computing 38, 325-340, 1987: column reduction, reduction transfer,
/// then one Dijkstra search for each row that is still free.
///
/// # Panics
/// If `costs` is not `n x n`.
pub fn least_cost(costs: &[f32], n: usize) -> Vec<usize> {
    assert_eq!(costs.len(), n * n);
    const NONE: usize = usize::MAX;
    let row = |i: usize| &costs[i * n..(i + 1) * n];
    let mut column_of = vec![NONE; n];
    let mut row_of = vec![NONE; n];
    let mut price = vec![0f32; n];
    // Column reduction: each column goes to its cheapest row, if that is still free.
    for j in (0..n).rev() {
        let mut best = 0;
        for i in 1..n {
            if row(i)[j] < row(best)[j] {
                best = i;
            }
        }
        price[j] = row(best)[j];
        if column_of[best] == NONE {
            column_of[best] = j;
            row_of[j] = best;
        }
    }
    // Augmenting row reduction, twice: a free row takes its cheapest column and outbids the second.
    let mut free: Vec<usize> = (0..n).filter(|i| column_of[*i] == NONE).collect();
    for _ in 0..2 {
        let mut still = Vec::new();
        let mut k = 0;
        let mut budget = 4 * n;
        while k < free.len() {
            let i = free[k];
            k += 1;
            let (mut best, mut first, mut second) = (0, f32::MAX, f32::MAX);
            for (j, (c, p)) in row(i).iter().zip(&price).enumerate() {
                let d = c - p;
                if d < first {
                    (second, first, best) = (first, d, j);
                } else if d < second {
                    second = d;
                }
            }
            let previous = row_of[best];
            if first < second {
                price[best] -= second - first;
            } else if previous != NONE {
                still.push(i);
                continue;
            }
            column_of[i] = best;
            row_of[best] = i;
            if previous != NONE {
                column_of[previous] = NONE;
                if first < second && budget > 0 {
                    budget -= 1;
                    k -= 1;
                    free[k] = previous;
                } else {
                    still.push(previous);
                }
            }
        }
        free = still;
    }
    // Dijkstra from each row that is left.
    let mut distance = vec![0f32; n];
    let mut from = vec![0usize; n];
    let mut todo: Vec<usize> = Vec::with_capacity(n);
    let mut done: Vec<usize> = Vec::with_capacity(n);
    for start in free {
        todo.clear();
        done.clear();
        todo.extend(0..n);
        for j in 0..n {
            distance[j] = row(start)[j] - price[j];
            from[j] = start;
        }
        let (end, shortest) = loop {
            let nearest = (0..todo.len())
                .min_by(|a, b| distance[todo[*a]].total_cmp(&distance[todo[*b]]))
                .expect("a square matrix has a free column left");
            let j = todo.swap_remove(nearest);
            let so_far = distance[j];
            let i = row_of[j];
            if i == NONE {
                break (j, so_far);
            }
            done.push(j);
            let base = so_far - (row(i)[j] - price[j]);
            let costs = row(i);
            for &k in &todo {
                let d = base + costs[k] - price[k];
                if d < distance[k] {
                    distance[k] = d;
                    from[k] = i;
                }
            }
        };
        for &j in &done {
            price[j] += distance[j] - shortest;
        }
        let mut j = end;
        loop {
            let i = from[j];
            row_of[j] = i;
            let next = column_of[i];
            column_of[i] = j;
            if i == start {
                break;
            }
            j = next;
        }
    }
    column_of
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
