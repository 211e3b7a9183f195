//! Products of matrices, by the library `gemm`.

use gemm::Parallelism;

/// A matrix inside a slice.
#[derive(Debug, Clone, Copy)]
pub struct Matrix<'a> {
    values: &'a [f32],
    shape: Shape,
}

/// A matrix inside a slice, to be written.
#[derive(Debug)]
pub struct MatrixMut<'a> {
    values: &'a mut [f32],
    shape: Shape,
}

#[derive(Debug, Clone, Copy, PartialEq)]
struct Shape {
    rows: usize,
    columns: usize,
    row_stride: usize,
    column_stride: usize,
}

impl Shape {
    fn of(len: usize, columns: usize) -> Self {
        assert!(columns > 0 && len.is_multiple_of(columns), "whole rows");
        Self {
            rows: len / columns,
            columns,
            row_stride: columns,
            column_stride: 1,
        }
    }

    /// The shape of `count` columns after the first `from`. Rows must not overlap: several threads write to them.
    fn columns(self, from: usize, count: usize) -> Self {
        assert!(
            self.column_stride == 1 && from + count <= self.columns,
            "as many columns"
        );
        Self {
            columns: count,
            ..self
        }
    }

    fn is_within(&self, len: usize) -> bool {
        let last = |count: usize, stride: usize| count.saturating_sub(1) * stride;
        self.rows * self.columns == 0
            || last(self.rows, self.row_stride) + last(self.columns, self.column_stride) < len
    }
}

impl<'a> Matrix<'a> {
    /// Rows of `columns` numbers each.
    ///
    /// # Panics
    /// If the last row is not whole.
    pub fn new(values: &'a [f32], columns: usize) -> Self {
        let shape = Shape::of(values.len(), columns);
        Self { values, shape }
    }

    /// Rows as columns.
    pub fn transposed(self) -> Self {
        let s = self.shape;
        let shape = Shape {
            rows: s.columns,
            columns: s.rows,
            row_stride: s.column_stride,
            column_stride: s.row_stride,
        };
        Self { shape, ..self }
    }

    /// Columns `from..from + count` of a matrix that is not transposed.
    ///
    /// # Panics
    /// If it has fewer columns, or is transposed.
    pub fn columns(self, from: usize, count: usize) -> Self {
        Self {
            shape: self.shape.columns(from, count),
            values: &self.values[from..],
        }
    }
}

impl<'a> MatrixMut<'a> {
    /// Rows of `columns` numbers each.
    ///
    /// # Panics
    /// If the last row is not whole.
    pub fn new(values: &'a mut [f32], columns: usize) -> Self {
        let shape = Shape::of(values.len(), columns);
        Self { values, shape }
    }

    /// Columns `from..from + count`.
    ///
    /// # Panics
    /// If it has fewer columns.
    pub fn columns(self, from: usize, count: usize) -> Self {
        Self {
            shape: self.shape.columns(from, count),
            values: &mut self.values[from..],
        }
    }

    /// `self += a b`, with the threads of the pool it is called in; their number changes no bit.
    ///
    /// # Panics
    /// If the shapes do not fit.
    pub fn add_product(self, a: Matrix<'_>, b: Matrix<'_>) {
        self.product(a, b, true);
    }

    /// `self = a b`.
    ///
    /// # Panics
    /// If the shapes do not fit.
    pub fn set_product(self, a: Matrix<'_>, b: Matrix<'_>) {
        self.product(a, b, false);
    }

    #[expect(unsafe_code, reason = "the library takes pointers and strides")]
    fn product(self, a: Matrix<'_>, b: Matrix<'_>, add: bool) {
        let (m, k, n) = (a.shape.rows, a.shape.columns, b.shape.columns);
        assert!(b.shape.rows == k && self.shape.rows == m && self.shape.columns == n);
        assert!(self.shape.is_within(self.values.len()));
        assert!(a.shape.is_within(a.values.len()) && b.shape.is_within(b.values.len()));
        let strides = |s: Shape| (s.column_stride as isize, s.row_stride as isize);
        let (out_column, out_row) = strides(self.shape);
        let (a_column, a_row) = strides(a.shape);
        let (b_column, b_row) = strides(b.shape);
        // SAFETY: every element addressed lies inside its slice, as just asserted; `self` is borrowed
        // mutably, so it overlaps neither factor.
        unsafe {
            gemm::gemm(
                m,
                n,
                k,
                self.values.as_mut_ptr(),
                out_column,
                out_row,
                add,
                a.values.as_ptr(),
                a_column,
                a_row,
                b.values.as_ptr(),
                b_column,
                b_row,
                1.0,
                1.0,
                false,
                false,
                false,
                Parallelism::Rayon(0),
            );
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn products_of_parts_and_transposes_are_the_sums_they_stand_for() {
        let a: Vec<f32> = (0..15).map(|i| i as f32 - 4.0).collect();
        let b: Vec<f32> = (0..12).map(|i| 0.5 * i as f32).collect();
        // a is 3 x 5, of which columns 1..5; b is 3 x 4, transposed 4 x 3; out is 3 x 7, of which 2..5.
        let mut out = vec![1.0; 21];
        MatrixMut::new(&mut out, 7).columns(2, 3).add_product(
            Matrix::new(&a, 5).columns(1, 4),
            Matrix::new(&b, 4).transposed(),
        );
        for i in 0..3 {
            for j in 0..7 {
                let inside = (2..5).contains(&j);
                let sum: f32 = (0..4)
                    .filter(|_| inside)
                    .map(|k| a[5 * i + 1 + k] * b[4 * (j.max(2) - 2) + k])
                    .sum();
                assert_eq!(out[7 * i + j], 1.0 + sum);
            }
        }
        let mut square = vec![f32::NAN; 25];
        MatrixMut::new(&mut square, 5)
            .set_product(Matrix::new(&a, 5).transposed(), Matrix::new(&a, 5));
        let expected: f32 = (0..3).map(|k| a[5 * k + 1] * a[5 * k + 4]).sum();
        assert_eq!(square[9], expected);
    }

    #[test]
    #[should_panic(expected = "as many columns")]
    fn columns_that_are_not_there_are_a_bug() {
        Matrix::new(&[0.0; 6], 3).columns(2, 2);
    }

    #[test]
    #[should_panic(expected = "assertion failed")]
    fn shapes_that_do_not_fit_are_a_bug() {
        let a = [0.0; 6];
        let mut out = [0.0; 4];
        MatrixMut::new(&mut out, 2).set_product(Matrix::new(&a, 3), Matrix::new(&a, 3));
    }
}
