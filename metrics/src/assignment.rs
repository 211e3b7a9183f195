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
    // Column reduction: each column goes to its cheapest row, if that is still free. Row by row, as
    // the matrix lies in memory.
    let mut cheapest = vec![0usize; n];
    price.copy_from_slice(row(0));
    for i in 1..n {
        for ((c, p), best) in row(i).iter().zip(&mut price).zip(&mut cheapest) {
            if c < p {
                *p = *c;
                *best = i;
            }
        }
    }
    for j in (0..n).rev() {
        if column_of[cheapest[j]] == NONE {
            column_of[cheapest[j]] = j;
            row_of[j] = cheapest[j];
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
            let (best, first, second) = two_least(row(i), &price);
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
    // Dijkstra from each row that is left. All columns take part in each pass, so that the passes
    // are plain loops over arrays; a column that is done stands at minus infinity.
    let mut distance = vec![0f32; n];
    let mut from = vec![0u32; n];
    let mut done: Vec<(usize, f32)> = Vec::with_capacity(n);
    for start in free {
        done.clear();
        for ((d, c), p) in distance.iter_mut().zip(row(start)).zip(&price) {
            *d = c - p;
        }
        from.fill(start as u32);
        let (end, shortest) = loop {
            let (j, so_far) = nearest(&distance);
            let i = row_of[j];
            if i == NONE {
                break (j, so_far);
            }
            done.push((j, so_far));
            distance[j] = f32::NEG_INFINITY;
            let base = so_far - (row(i)[j] - price[j]);
            let columns = distance.iter_mut().zip(&mut from);
            for (((d, f), c), p) in columns.zip(row(i)).zip(&price) {
                let new = base + (c - p);
                let is_shorter = new < *d;
                *d = if is_shorter { new } else { *d };
                *f = if is_shorter { i as u32 } else { *f };
            }
        };
        for &(j, so_far) in &done {
            price[j] += so_far - shortest;
        }
        let mut j = end;
        loop {
            let i = from[j] as usize;
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

/// Lanes of the loops that the compiler shall turn into vectors.
const LANES: usize = 16;

fn smaller(a: f32, b: f32) -> f32 {
    if b < a { b } else { a }
}

/// Place of the least cost less price, that value, and the second least.
fn two_least(costs: &[f32], price: &[f32]) -> (usize, f32, f32) {
    let mut first = [f32::INFINITY; LANES];
    let mut second = [f32::INFINITY; LANES];
    let (c, p) = (costs.chunks_exact(LANES), price.chunks_exact(LANES));
    let rest = c.remainder().iter().zip(p.remainder());
    for (c, p) in c.zip(p) {
        for k in 0..LANES {
            let d = c[k] - p[k];
            let larger = if d > first[k] { d } else { first[k] };
            second[k] = smaller(second[k], larger);
            first[k] = smaller(first[k], d);
        }
    }
    let lanes = first.into_iter().chain(second);
    let (mut one, mut two) = (f32::INFINITY, f32::INFINITY);
    for d in lanes.chain(rest.map(|(c, p)| c - p)) {
        if d < one {
            (two, one) = (one, d);
        } else {
            two = smaller(two, d);
        }
    }
    let place = costs.iter().zip(price).position(|(c, p)| c - p == one);
    (place.expect("it is one of them"), one, two)
}

/// Place and value of the smallest finite distance, the first of equals.
fn nearest(distance: &[f32]) -> (usize, f32) {
    let open = |d: f32| {
        if d == f32::NEG_INFINITY {
            f32::INFINITY
        } else {
            d
        }
    };
    let mut least = [f32::INFINITY; LANES];
    let chunks = distance.chunks_exact(LANES);
    let rest = chunks.remainder();
    for chunk in chunks {
        for (l, d) in least.iter_mut().zip(chunk) {
            let d = open(*d);
            *l = smaller(*l, d);
        }
    }
    let value = least
        .into_iter()
        .chain(rest.iter().map(|d| open(*d)))
        .fold(f32::INFINITY, smaller);
    let place = distance.iter().position(|d| *d == value);
    (place.expect("a column is left"), value)
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
