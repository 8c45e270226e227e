use super::{Id, PickledArrays};
use crate::arrays::Array;
use crate::place::excerpt;
use crate::{Place, Result};

/// Rows of a matrix at most: there is one a joint.
const ROWS: usize = 4096;

/// A sparse matrix by rows: `(column, value)`, columns ascending.
#[derive(Clone, Debug, PartialEq)]
pub struct SparseRows {
    /// Columns.
    pub columns: usize,
    /// `[rows]`.
    pub rows: Vec<Vec<(u32, f64)>>,
}

impl SparseRows {
    /// Of a dense matrix; zeros are dropped.
    ///
    /// # Errors
    /// An array of another number of dimensions, of too many rows or no columns, or with an entry that is no number.
    pub fn dense(array: &Array) -> Result<Self> {
        array.expect_shape(&[None, None])?;
        let (rows, columns) = (array.shape()[0], array.shape()[1]);
        if rows > ROWS || columns == 0 {
            return Err(array.refuse(format!("{rows} x {columns}, expected at most {ROWS} rows and a column or more")));
        }
        let nonzero =
            |row: &[f64]| row.iter().enumerate().filter(|(_, x)| **x != 0.0).map(|(c, x)| (c as u32, *x)).collect();
        Ok(Self { columns, rows: array.f64s()?.chunks_exact(columns).map(nonzero).collect() })
    }

    /// SciPy's `csc_matrix`, `csr_matrix` and `coo_matrix` of whatever age. `None` where `id` is no such object.
    ///
    /// # Errors
    /// A matrix whose parts do not fit together; named by `place`.
    pub fn read(arrays: &PickledArrays<'_>, id: Id, place: &Place) -> Result<Option<Self>> {
        let p = arrays.pickle;
        let Some((module, name, _, Some(state))) = p.object(id) else { return Ok(None) };
        if !module.starts_with("scipy.sparse") {
            return Ok(None);
        }
        // Before SciPy 1.0 the shape stood without its underscore.
        let shape = p.value(state, "_shape").or_else(|| p.value(state, "shape"));
        let shape = shape.and_then(|s| p.items(s)).and_then(|s| s.iter().map(|i| p.size(*i)).collect());
        let broken = |what: &str| place.refuse(format!("its sparse matrix {what}; get the file again"));
        let Some([rows, columns]) = shape.and_then(|s: Vec<usize>| <[usize; 2]>::try_from(s).ok()) else {
            return Err(broken("has no shape"));
        };
        if rows > ROWS || columns > arrays.limits.array_bytes as usize / 8 {
            return Err(broken(&format!("of {rows} x {columns} is too large")));
        }
        let part = |key: &str| match p.value(state, key) {
            Some(id) => arrays.array(id, place),
            None => Err(broken(&format!("lacks {key}"))),
        };
        let values = part("data")?.f64s()?;
        let entries = match name {
            "csc_matrix" | "csr_matrix" | "csc_array" | "csr_array" => {
                let (inner, starts) = (part("indices")?.integers()?, part("indptr")?.integers()?);
                let by_column = name.starts_with("csc");
                let outer_count = if by_column { columns } else { rows };
                let starts: Option<Vec<usize>> = starts.iter().map(|s| usize::try_from(*s).ok()).collect();
                let starts = starts.filter(|s| s.len() == outer_count + 1).ok_or_else(|| broken("has other starts"))?;
                let mut entries = Vec::with_capacity(values.len());
                for (outer, span) in starts.windows(2).enumerate() {
                    let inside = inner.get(span[0]..span[1]).zip(values.get(span[0]..span[1]));
                    let (indices, values) = inside.ok_or_else(|| broken("has starts out of order"))?;
                    for (i, x) in indices.iter().zip(values) {
                        entries.push(if by_column { (*i, outer as i64, *x) } else { (outer as i64, *i, *x) });
                    }
                    if entries.len() > values.len().max(inner.len()) {
                        return Err(broken("has starts out of order"));
                    }
                }
                entries
            }
            "coo_matrix" | "coo_array" => {
                let (row, column) = (part("row")?.integers()?, part("col")?.integers()?);
                if row.len() != values.len() || column.len() != values.len() {
                    return Err(broken("has other numbers of rows, columns and values"));
                }
                row.iter().zip(&column).zip(&values).map(|((r, c), x)| (*r, *c, *x)).collect()
            }
            other => return Err(broken(&format!("is a {}, which is not read", excerpt(other)))),
        };
        let mut out = vec![Vec::new(); rows];
        for (row, column, x) in entries {
            let inside = usize::try_from(row).ok().and_then(|r| out.get_mut(r));
            let column = usize::try_from(column).ok().filter(|c| *c < columns);
            match (inside, column) {
                (Some(row), Some(column)) => row.push((column as u32, x)),
                _ => return Err(broken("names a row or column past the last")),
            }
        }
        out.iter_mut().for_each(|row| row.sort_by_key(|(c, _)| *c));
        Ok(Some(Self { columns, rows: out }))
    }
}
