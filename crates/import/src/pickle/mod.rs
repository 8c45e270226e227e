//! Python's pickles, read as data: nothing in them is ever called or imported. What a pickle would construct stays an
//! [`Node::Object`] with the name of its class, its arguments and its state, and [`crate::pickle`] knows the few classes
//! that body models are made of: NumPy's arrays, SciPy's sparse matrices, chumpy's wrappers.
//!
//! Nodes lie in one list and name each other by number, so that neither nesting nor cycles need a stack.
//!
//! Source: CPython's `Lib/pickletools.py`, protocols 0 to 5 without out-of-band buffers.

mod arrays;
mod escapes;
mod machine;
mod opcodes;
mod sparse;

pub use arrays::PickledArrays;
pub use sparse::SparseRows;

use machine::Machine;

/// What a reader of pickles is willing to accept.
#[derive(Clone, Copy, Debug)]
pub struct PickleLimits {
    /// Objects in one pickle. Default two million: a model has some hundred.
    pub nodes: usize,
    /// Bytes of texts and byte strings that had to be decoded. Default 384 MiB.
    pub decoded_bytes: usize,
}

impl Default for PickleLimits {
    fn default() -> Self {
        Self { nodes: 2_000_000, decoded_bytes: 384 << 20 }
    }
}

/// Number of a node.
pub type Id = u32;

/// One object of a pickle.
#[derive(Clone, Debug, PartialEq)]
pub enum Node {
    /// None, and whatever is of no use here (sets, for one).
    None,
    /// True or false.
    Bool(bool),
    /// An integer that fits 64 bits.
    Int(i64),
    /// Another integer: only that it is one is kept.
    BigInt,
    /// A number.
    Float(f64),
    /// Bytes of the file from one place to another: Python 2's `str`, Python 3's `bytes`.
    Bytes(usize, usize),
    /// Bytes that the file holds in another form.
    Decoded(Vec<u8>),
    /// Text.
    Text(String),
    /// A list.
    List(Vec<Id>),
    /// A tuple.
    Tuple(Vec<Id>),
    /// A dictionary, in order.
    Dict(Vec<(Id, Id)>),
    /// A class or function, by name.
    Global(String, String),
    /// What a class or function would have made of its arguments.
    Object {
        /// The class or function.
        class: Id,
        /// Its arguments, a tuple as a rule.
        arguments: Id,
        /// What was given to `__setstate__`.
        state: Option<Id>,
    },
}

/// A pickle, as a list of nodes.
#[derive(Debug)]
pub struct Pickle<'a> {
    bytes: &'a [u8],
    nodes: Vec<Node>,
    root: Id,
}

impl<'a> Pickle<'a> {
    /// Reads the first pickle in `bytes`.
    ///
    /// # Errors
    /// A sentence with the offset: truncated, too large, or an opcode that is unknown or out of place.
    pub fn read(bytes: &'a [u8], limits: &PickleLimits) -> Result<Self, String> {
        let mut machine = Machine::new(bytes, *limits);
        let root = machine.run()?;
        Ok(Self { bytes, nodes: machine.into_nodes(), root })
    }

    /// The object that the pickle is of.
    pub fn root(&self) -> Id {
        self.root
    }

    /// A node by number.
    pub fn node(&self, id: Id) -> &Node {
        &self.nodes[id as usize]
    }

    /// Bytes of a byte string.
    pub fn bytes(&self, id: Id) -> Option<&[u8]> {
        match self.node(id) {
            Node::Bytes(start, end) => Some(&self.bytes[*start..*end]),
            Node::Decoded(bytes) => Some(bytes),
            Node::Object { .. } => self.encoded_text(id),
            _ => None,
        }
    }

    /// Text of a text, or of a byte string in UTF-8: the pythons differ.
    pub fn text(&self, id: Id) -> Option<&str> {
        match self.node(id) {
            Node::Text(text) => Some(text),
            _ => std::str::from_utf8(self.bytes(id)?).ok(),
        }
    }

    /// Elements of a list or tuple.
    pub fn items(&self, id: Id) -> Option<&[Id]> {
        match self.node(id) {
            Node::List(items) | Node::Tuple(items) => Some(items),
            _ => None,
        }
    }

    /// The value under a key of a dictionary.
    pub fn value(&self, dictionary: Id, key: &str) -> Option<Id> {
        let Node::Dict(pairs) = self.node(dictionary) else { return None };
        // Of a key that stands twice Python keeps the last.
        pairs.iter().rev().find(|(k, _)| self.is_text(*k, key)).map(|(_, v)| *v)
    }

    /// By length first: a long key may stand in a dictionary a million times.
    fn is_text(&self, id: Id, expected: &str) -> bool {
        match self.node(id) {
            Node::Text(text) => text == expected,
            _ => self.bytes(id) == Some(expected.as_bytes()),
        }
    }

    /// Texts among the first 40 keys of a dictionary.
    pub fn keys(&self, dictionary: Id) -> Vec<&str> {
        let Node::Dict(pairs) = self.node(dictionary) else { return Vec::new() };
        pairs.iter().take(40).filter_map(|(k, _)| self.text(*k)).collect()
    }

    /// A small non-negative integer.
    pub fn size(&self, id: Id) -> Option<usize> {
        match self.node(id) {
            Node::Int(x) => usize::try_from(*x).ok(),
            _ => None,
        }
    }

    /// Module and name of an object's class, its arguments and its state.
    pub fn object(&self, id: Id) -> Option<(&str, &str, Id, Option<Id>)> {
        let Node::Object { class, arguments, state } = self.node(id) else { return None };
        let Node::Global(module, name) = self.node(*class) else { return None };
        Some((module, name, *arguments, *state))
    }

    /// `_codecs.encode(text, "latin1")`: how Python 3 writes bytes in protocol 2. The machine has put the bytes in the
    /// place of the text.
    fn encoded_text(&self, id: Id) -> Option<&[u8]> {
        let ("_codecs", "encode", arguments, _) = self.object(id)? else { return None };
        match self.node(*self.items(arguments)?.first()?) {
            Node::Decoded(bytes) => Some(bytes),
            _ => None,
        }
    }
}
