//! Least squares with a handful of unknowns.

/// The x that makes the sum of w (y - a x)^2 least; nothing where the data cannot tell.
pub fn least_squares<const N: usize>(
    rows: &[([f64; N], f64, f64)],
    used: usize,
) -> Option<[f64; N]> {
    let mut matrix = [[0.0; N]; N];
    let mut right = [0.0; N];
    for (a, y, weight) in rows {
        for i in 0..used {
            right[i] += weight * a[i] * y;
            for j in 0..used {
                matrix[i][j] += weight * a[i] * a[j];
            }
        }
    }
    let diagonal: [f64; N] = std::array::from_fn(|i| matrix[i][i]);
    // Gauss without exchange: the matrix is positive definite where the data can tell.
    for k in 0..used {
        // Columns that depend on one another leave nothing of the diagonal.
        if matrix[k][k] <= 1e-7 * diagonal[k] || !matrix[k][k].is_finite() {
            return None;
        }
        for i in k + 1..used {
            let times = matrix[i][k] / matrix[k][k];
            let pivot = matrix[k];
            for (own, above) in matrix[i][k..used].iter_mut().zip(&pivot[k..used]) {
                *own -= times * above;
            }
            right[i] -= times * right[k];
        }
    }
    let mut x = [0.0; N];
    for k in (0..used).rev() {
        let known: f64 = (k + 1..used).map(|j| matrix[k][j] * x[j]).sum();
        x[k] = (right[k] - known) / matrix[k][k];
    }
    Some(x)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_plane_is_found_and_what_cannot_be_told_is_not() {
        let row = |i: i32| {
            let (a, b) = (f64::from(i % 5), f64::from(i % 7));
            ([1.0, a, b], 0.5 - 2.0 * a + 3.0 * b, 1.0 + a)
        };
        let rows: Vec<_> = (0..40).map(row).collect();
        let found = least_squares(&rows, 3).unwrap();
        for (found, expected) in found.iter().zip([0.5, -2.0, 3.0]) {
            assert!((found - expected).abs() < 1e-9, "{found}");
        }
        let same: Vec<_> =
            rows.iter().map(|(a, y, w)| ([a[0], a[1], 2.0 * a[1]], *y, *w)).collect();
        assert!(least_squares(&same, 3).is_none());
        assert!(least_squares::<3>(&[], 1).is_none());
    }
}
