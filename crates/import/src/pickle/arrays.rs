use super::{Id, Node, Pickle};
use crate::arrays::{Array, ArrayLimits, ElementType};
use crate::place::excerpt;
use crate::{Place, Result};

/// Wrappers of wrappers that are followed to an array: chumpy nests a few.
const WRAPPERS: usize = 8;

/// Looks up NumPy's arrays in a pickle.
#[derive(Clone, Copy)]
pub struct PickledArrays<'a> {
    /// The pickle.
    pub pickle: &'a Pickle<'a>,
    /// Limits of one array.
    pub limits: &'a ArrayLimits,
}

impl PickledArrays<'_> {
    /// The array that an object is, holds or wraps: a NumPy array or scalar, a chumpy object, a number, or a list of
    /// numbers.
    ///
    /// # Errors
    /// Anything else, or an array whose data do not fit its shape; named by `place`.
    pub fn array(&self, id: Id, place: &Place) -> Result<Array> {
        self.unwrapped(id, place, WRAPPERS)
    }

    fn unwrapped(&self, id: Id, place: &Place, depth: usize) -> Result<Array> {
        let p = self.pickle;
        if let Some(numbers) = self.plain_numbers(id) {
            let shape = if p.items(id).is_some() { vec![numbers.len()] } else { vec![] };
            return self.of_numbers(&numbers, shape, place);
        }
        let Some((module, name, arguments, state)) = p.object(id) else {
            return Err(place.refuse("it is no array; is the file a body model?"));
        };
        let class = || format!("{}.{}", excerpt(module), excerpt(name));
        if depth == 0 {
            return Err(place.refuse(format!("it is wrapped more than {WRAPPERS} times")));
        }
        if module.starts_with("numpy") {
            return match name {
                "_reconstruct" => self.reconstructed(state, place, depth),
                "_frombuffer" => self.buffered(arguments, place),
                "scalar" => self.scalar(arguments, place),
                _ => Err(place.refuse(format!("it is a {}, expected an array", class()))),
            };
        }
        let Some(state) = state else {
            return Err(place.refuse(format!("it is a {} without a state, expected an array", class())));
        };
        if let Some(inner) = p.value(state, "x") {
            return self.unwrapped(inner, place, depth - 1);
        }
        match (p.value(state, "a"), p.value(state, "idxs")) {
            (Some(inner), Some(chosen)) => self.selected(state, inner, chosen, place, depth),
            _ => Err(place.refuse(format!("it is a {}, expected an array", class()))),
        }
    }

    /// chumpy's `Select`: some entries of an array, in another shape.
    fn selected(&self, state: Id, inner: Id, chosen: Id, place: &Place, depth: usize) -> Result<Array> {
        let source = self.unwrapped(inner, place, depth - 1)?.f64s()?;
        // A plain array: two ways down at every level would double the work with each.
        let chosen = self.unwrapped(chosen, place, 1)?.integers()?;
        let picked = chosen.iter().map(|i| usize::try_from(*i).ok().and_then(|i| source.get(i)).copied());
        let picked: Option<Vec<f64>> = picked.collect();
        let picked = picked.ok_or_else(|| place.refuse("it selects entries that its array has not"))?;
        let shape = self.pickle.value(state, "preferred_shape").and_then(|s| self.shape(s));
        let shape = shape.unwrap_or_else(|| vec![picked.len()]);
        self.of_numbers(&picked, shape, place)
    }

    /// `numpy.core.multiarray._reconstruct`: version, shape, type, order, data.
    fn reconstructed(&self, state: Option<Id>, place: &Place, depth: usize) -> Result<Array> {
        let p = self.pickle;
        let broken = || place.refuse("it is an array without shape, type or data; get the file again");
        let items = state.and_then(|s| p.items(s)).ok_or_else(broken)?;
        let [.., shape, element, order, data] = items else { return Err(broken()) };
        let shape = self.shape(*shape).ok_or_else(broken)?;
        let element = self.element(*element).map_err(|e| place.refuse(e))?;
        let fortran_order = matches!(p.node(*order), Node::Bool(true) | Node::Int(1));
        if let Some(items) = p.items(*data) {
            return self.of_objects(items, shape, place, depth);
        }
        let bytes = p.bytes(*data).ok_or_else(broken)?.to_vec();
        Array::from_raw(place.clone(), element, fortran_order, shape, bytes, self.limits)
    }

    /// An array of objects counts where they are numbers, or where it is a box of one thing.
    fn of_objects(&self, items: &[Id], shape: Vec<usize>, place: &Place, depth: usize) -> Result<Array> {
        let numbers: Option<Vec<f64>> = items.iter().map(|i| self.plain_number(*i)).collect();
        match (numbers, items) {
            (Some(numbers), _) if shape.len() < 2 => self.of_numbers(&numbers, shape, place),
            (None, [only]) => self.unwrapped(*only, place, depth - 1),
            _ => Err(place.refuse("it holds Python objects, expected numbers; save it with a numeric type")),
        }
    }

    /// What an array of one object holds; anything else is itself.
    pub fn unboxed(&self, id: Id) -> Id {
        let state = self.pickle.object(id).filter(|(m, n, ..)| m.starts_with("numpy") && *n == "_reconstruct");
        let items = state.and_then(|(.., state)| self.pickle.items(state?));
        let data = items.and_then(|items| self.pickle.items(*items.last()?));
        if let Some([only]) = data { *only } else { id }
    }

    /// `numpy.core.numeric._frombuffer`: data, type, shape, order (protocol 5).
    fn buffered(&self, arguments: Id, place: &Place) -> Result<Array> {
        let p = self.pickle;
        let broken = || place.refuse("it is an array without shape, type or data; get the file again");
        let Some([data, element, shape, order]) = p.items(arguments) else { return Err(broken()) };
        let element = self.element(*element).map_err(|e| place.refuse(e))?;
        let (shape, bytes) = (self.shape(*shape).ok_or_else(broken)?, p.bytes(*data).ok_or_else(broken)?.to_vec());
        Array::from_raw(place.clone(), element, p.text(*order) == Some("F"), shape, bytes, self.limits)
    }

    fn scalar(&self, arguments: Id, place: &Place) -> Result<Array> {
        let p = self.pickle;
        let broken = || place.refuse("it is a number without type or data; get the file again");
        let Some([element, data]) = p.items(arguments) else { return Err(broken()) };
        let element = self.element(*element).map_err(|e| place.refuse(e))?;
        let bytes = p.bytes(*data).ok_or_else(broken)?.to_vec();
        Array::from_raw(place.clone(), element, false, vec![], bytes, self.limits)
    }

    /// `numpy.dtype('f8', ...)` with the byte order in its state.
    fn element(&self, id: Id) -> std::result::Result<ElementType, String> {
        let p = self.pickle;
        let description = p
            .object(id)
            .filter(|(module, name, ..)| module.starts_with("numpy") && name.to_lowercase().contains("dtype"))
            .and_then(|(_, _, arguments, state)| Some((p.text(*p.items(arguments)?.first()?)?, state)));
        let Some((text, state)) = description else { return Err("its elements have no type".into()) };
        let order = state.and_then(|s| p.text(*p.items(s)?.get(1)?)).unwrap_or("<");
        let order = if order == ">" { ">" } else { "<" };
        ElementType::parse(&format!("{order}{text}"))
            .ok_or_else(|| format!("its elements are of type {:?}, which is not read", excerpt(text)))
    }

    fn shape(&self, id: Id) -> Option<Vec<usize>> {
        self.pickle.items(id)?.iter().map(|i| self.pickle.size(*i)).collect()
    }

    fn plain_numbers(&self, id: Id) -> Option<Vec<f64>> {
        match self.pickle.items(id) {
            Some(items) => items.iter().map(|i| self.plain_number(*i)).collect(),
            None => self.plain_number(id).map(|x| vec![x]),
        }
    }

    fn plain_number(&self, id: Id) -> Option<f64> {
        match self.pickle.node(id) {
            Node::Int(x) => Some(*x as f64),
            Node::Float(x) => Some(*x),
            Node::Bool(x) => Some(f64::from(u8::from(*x))),
            _ => None,
        }
    }

    fn of_numbers(&self, numbers: &[f64], shape: Vec<usize>, place: &Place) -> Result<Array> {
        let element = ElementType { kind: crate::arrays::ElementKind::Float, size: 8, big_endian: false };
        let bytes = numbers.iter().flat_map(|x| x.to_le_bytes()).collect();
        Array::from_raw(place.clone(), element, false, shape, bytes, self.limits)
    }
}
