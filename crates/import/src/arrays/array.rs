use super::header::Header;
use super::{ArrayLimits, ElementKind, ElementType};
use crate::{ImportError, Place, Result};

/// An array as it lies in a file. Conversions give the elements in C order (last index fastest), whatever the file's.
#[derive(Clone, Debug)]
pub struct Array {
    place: Place,
    element: ElementType,
    fortran_order: bool,
    shape: Vec<usize>,
    bytes: Vec<u8>,
    /// Where in `bytes` the data begin.
    data: usize,
    /// Bytes that the elements may take once they are converted.
    limit: u64,
}

impl Array {
    /// From the bytes of an npy file.
    ///
    /// # Errors
    /// A head that is refused, or fewer or more data than it states.
    pub fn from_npy(place: Place, bytes: Vec<u8>, limits: &ArrayLimits) -> Result<Self> {
        let Header { element, fortran_order, shape, data } =
            Header::parse(&bytes, limits).map_err(|reason| place.refuse(reason))?;
        let array = Self { place, element, fortran_order, shape, bytes, data, limit: limits.array_bytes };
        // The pickle of an object array says by itself where it ends.
        if element.kind != ElementKind::Object {
            array.check_length()?;
        }
        Ok(array)
    }

    /// From raw elements, as they stand in a pickle.
    ///
    /// # Errors
    /// Objects; fewer or more data than the shape states.
    pub(crate) fn from_raw(
        place: Place,
        element: ElementType,
        fortran_order: bool,
        shape: Vec<usize>,
        bytes: Vec<u8>,
        limits: &ArrayLimits,
    ) -> Result<Self> {
        let header = Header { element, fortran_order, shape, data: 0 };
        header.check(limits).map_err(|reason| place.refuse(reason))?;
        let (shape, limit) = (header.shape, limits.array_bytes);
        let array = Self { place, element, fortran_order, shape, bytes, data: 0, limit };
        array.check_length()?;
        Ok(array)
    }

    fn check_length(&self) -> Result<()> {
        // Checked against overflow together with the head.
        let expected = self.len() * self.element.size;
        let found = self.bytes.len() - self.data;
        if found == expected {
            return Ok(());
        }
        let shape = &self.shape;
        Err(self.refuse(format!("its shape {shape:?} takes {expected} bytes, it holds {found}; get the file again")))
    }

    /// Sizes, slowest index first; empty for a single value.
    pub fn shape(&self) -> &[usize] {
        &self.shape
    }
    /// Type of the elements.
    pub fn element(&self) -> ElementType {
        self.element
    }
    /// Elements in all.
    pub fn len(&self) -> usize {
        self.shape.iter().product()
    }
    /// Whether there is no element.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }
    /// Where it stands.
    pub fn place(&self) -> &Place {
        &self.place
    }
    /// A refusal that names this array.
    pub fn refuse(&self, reason: impl Into<String>) -> ImportError {
        self.place.refuse(reason)
    }

    /// Refuses another shape; `None` stands for any size.
    pub fn expect_shape(&self, expected: &[Option<usize>]) -> Result<()> {
        let fits = self.shape.len() == expected.len()
            && self.shape.iter().zip(expected).all(|(found, wanted)| wanted.is_none_or(|w| w == *found));
        if fits {
            return Ok(());
        }
        let text: Vec<String> = expected.iter().map(|w| w.map_or("any".into(), |w| w.to_string())).collect();
        Err(self.refuse(format!("its shape is {:?}, expected [{}]", self.shape, text.join(", "))))
    }

    /// Numbers as they are.
    ///
    /// # Errors
    /// No numbers, or one that is not finite.
    pub fn f64s(&self) -> Result<Vec<f64>> {
        self.finite(|x| x, f64::is_finite)
    }

    /// Numbers in single precision.
    ///
    /// # Errors
    /// No numbers, or one that is not finite or leaves the range of single precision.
    pub fn f32s(&self) -> Result<Vec<f32>> {
        self.finite(|x| x as f32, f32::is_finite)
    }

    /// Whole numbers, exactly. Floating-point numbers without a fraction count.
    ///
    /// # Errors
    /// Anything else.
    pub fn integers(&self) -> Result<Vec<i64>> {
        self.numeric()?;
        let convert = |bytes: &[u8]| self.element.integer(bytes);
        self.elements(convert, "is no whole number")
    }

    /// The only number there is.
    ///
    /// # Errors
    /// No number, several, or one that is not finite.
    pub fn number(&self) -> Result<f64> {
        let not_one = || self.refuse(format!("its shape is {:?}, expected a single number", self.shape));
        if self.element.is_numeric() && self.len() != 1 {
            return Err(not_one());
        }
        self.f64s()?.pop().ok_or_else(not_one)
    }

    /// Texts, without the zeros that pad them; byte strings must be UTF-8.
    ///
    /// # Errors
    /// Anything else.
    pub fn texts(&self) -> Result<Vec<String>> {
        if !self.element.is_text() {
            return Err(self.refuse("it holds no text"));
        }
        let convert = |bytes: &[u8]| self.element.text(bytes);
        self.elements(convert, "is no valid text")
    }

    /// The only text there is.
    ///
    /// # Errors
    /// No text, or several.
    pub fn text(&self) -> Result<String> {
        let not_one = || self.refuse(format!("its shape is {:?}, expected a single text", self.shape));
        if self.element.is_text() && self.len() != 1 {
            return Err(not_one());
        }
        self.texts()?.pop().ok_or_else(not_one)
    }

    /// The pickle of an object array.
    pub(crate) fn pickle(&self) -> Option<&[u8]> {
        (self.element.kind == ElementKind::Object).then(|| &self.bytes[self.data..])
    }

    fn numeric(&self) -> Result<()> {
        if self.element.is_numeric() {
            return Ok(());
        }
        Err(self.refuse(match self.element.kind {
            ElementKind::Object => "it holds Python objects, expected numbers; save it with a numeric type",
            _ => "it holds text, expected numbers",
        }))
    }

    fn finite<T: Copy>(&self, convert: impl Fn(f64) -> T, is_finite: impl Fn(T) -> bool) -> Result<Vec<T>> {
        self.numeric()?;
        let checked = |bytes: &[u8]| Some(convert(self.element.number(bytes))).filter(|x| is_finite(*x));
        self.elements(checked, "is not finite (or not in range); mend or drop it")
    }

    /// Every element converted; `fault` says what one is that cannot be.
    fn elements<T>(&self, convert: impl Fn(&[u8]) -> Option<T>, fault: &str) -> Result<Vec<T>> {
        let (count, size) = (self.len(), self.element.size);
        if count == 0 {
            return Ok(Vec::new());
        }
        // Numbers of one byte become eight times as large, texts of none are still texts.
        if (count as u64).saturating_mul(size_of::<T>() as u64) > self.limit {
            let limit = self.limit;
            return Err(self.refuse(format!("its shape {:?} asks for more than {limit} bytes in memory", self.shape)));
        }
        let data = &self.bytes[self.data..];
        let mut out = Vec::with_capacity(count);
        let mut walk = Walk::new(&self.shape, self.fortran_order);
        for at in 0..count {
            let from = walk.offset * size;
            let element = convert(&data[from..from + size]);
            out.push(element.ok_or_else(|| self.refuse(format!("entry {} {fault}", self.index(at))))?);
            walk.step();
        }
        Ok(out)
    }

    /// The index of an element by its place in C order, as `[i, j]`.
    fn index(&self, mut at: usize) -> String {
        let mut index = vec![0; self.shape.len()];
        for (i, size) in index.iter_mut().zip(&self.shape).rev() {
            (*i, at) = (at % size, at / size);
        }
        format!("{index:?}")
    }
}

/// Walks an array in C order and says where the elements lie.
struct Walk<'a> {
    shape: &'a [usize],
    strides: Vec<usize>,
    index: Vec<usize>,
    offset: usize,
}

impl<'a> Walk<'a> {
    fn new(shape: &'a [usize], fortran_order: bool) -> Self {
        let mut strides = vec![1; shape.len()];
        for k in 1..shape.len() {
            if fortran_order {
                strides[k] = strides[k - 1] * shape[k - 1];
            } else {
                let last = shape.len() - 1;
                strides[last - k] = strides[last - k + 1] * shape[last - k + 1];
            }
        }
        Self { shape, strides, index: vec![0; shape.len()], offset: 0 }
    }

    fn step(&mut self) {
        for k in (0..self.shape.len()).rev() {
            self.index[k] += 1;
            self.offset += self.strides[k];
            if self.index[k] < self.shape[k] {
                return;
            }
            self.offset -= self.strides[k] * self.shape[k];
            self.index[k] = 0;
        }
    }
}
