use super::escapes::{raw_unicode, unescape};
use super::opcodes::*;
use super::{Id, Node, PickleLimits};
use std::collections::HashMap;

/// The stack machine that a pickle is a program for, less everything that would execute.
pub struct Machine<'a> {
    bytes: &'a [u8],
    at: usize,
    limits: PickleLimits,
    decoded: usize,
    /// Entries that were added to lists and dictionaries.
    entries: usize,
    nodes: Vec<Node>,
    stack: Vec<Id>,
    marks: Vec<usize>,
    memo: HashMap<u64, Id>,
}

type Step<T> = Result<T, String>;

impl<'a> Machine<'a> {
    pub fn new(bytes: &'a [u8], limits: PickleLimits) -> Self {
        let (nodes, stack, marks, memo) = (Vec::new(), Vec::new(), Vec::new(), HashMap::new());
        Self { bytes, at: 0, limits, decoded: 0, entries: 0, nodes, stack, marks, memo }
    }

    pub fn into_nodes(self) -> Vec<Node> {
        self.nodes
    }

    /// Runs to the stop and gives the object on top.
    pub fn run(&mut self) -> Step<Id> {
        loop {
            let start = self.at;
            let done = self.step().map_err(|reason| format!("{reason} (byte {start} of the pickle)"))?;
            if let Some(root) = done {
                return Ok(root);
            }
            let held = [self.nodes.len(), self.stack.len(), self.memo.len(), self.marks.len(), self.entries];
            if held.iter().any(|n| *n > self.limits.nodes) {
                return Err(format!("it makes more than {} objects", self.limits.nodes));
            }
        }
    }

    fn step(&mut self) -> Step<Option<Id>> {
        let opcode = self.take(1)?[0];
        match opcode {
            STOP => return self.pop().map(Some),
            PROTO => match self.take(1)?[0] {
                0..=5 => {}
                other => return Err(format!("it is of protocol {other}; protocols 0 to 5 are read")),
            },
            FRAME => {
                self.take(8)?;
            }
            MARK => self.marks.push(self.stack.len()),
            POP => {
                // A mark is popped like an object.
                if self.marks.last() == Some(&self.stack.len()) {
                    self.marks.pop();
                } else {
                    self.pop()?;
                }
            }
            POP_MARK => {
                self.pop_mark()?;
            }
            DUP => self.stack.push(self.top()?),
            NONE => self.push(Node::None),
            NEWTRUE => self.push(Node::Bool(true)),
            NEWFALSE => self.push(Node::Bool(false)),
            INT | LONG | FLOAT | BININT | BININT1 | BININT2 | LONG1 | LONG4 | BINFLOAT => self.number(opcode)?,
            STRING | UNICODE | BINSTRING | SHORT_BINSTRING | BINBYTES | SHORT_BINBYTES | BINBYTES8 | BYTEARRAY8
            | BINUNICODE | SHORT_BINUNICODE | BINUNICODE8 => self.string(opcode)?,
            GET | BINGET | LONG_BINGET | PUT | BINPUT | LONG_BINPUT | MEMOIZE => self.remember(opcode)?,
            GLOBAL | STACK_GLOBAL | REDUCE | NEWOBJ | NEWOBJ_EX | OBJ | INST | BUILD => self.construct(opcode)?,
            _ => self.collect(opcode)?,
        }
        Ok(None)
    }

    fn number(&mut self, opcode: u8) -> Step<()> {
        let node = match opcode {
            INT => match self.line()? {
                "00" => Node::Bool(false),
                "01" => Node::Bool(true),
                text => text.parse().map(Node::Int).map_err(|_| "it holds an integer that is none".to_owned())?,
            },
            LONG => self.line()?.trim_end_matches('L').parse().map_or(Node::BigInt, Node::Int),
            FLOAT => Node::Float(self.line()?.parse().map_err(|_| "it holds a number that is none")?),
            BININT => Node::Int(i64::from(i32::from_le_bytes(self.array()?))),
            BININT1 => Node::Int(i64::from(self.take(1)?[0])),
            BININT2 => Node::Int(i64::from(u16::from_le_bytes(self.array()?))),
            BINFLOAT => Node::Float(f64::from_be_bytes(self.array()?)),
            _ => {
                let size = if opcode == LONG1 { usize::from(self.take(1)?[0]) } else { self.length(4)? };
                let bytes = self.take(size)?;
                let sign = bytes.last().map_or(0, |b| if *b > 127 { 0xff } else { 0 });
                let mut word = [sign; 8];
                word.iter_mut().zip(bytes).for_each(|(w, b)| *w = *b);
                if size > 8 { Node::BigInt } else { Node::Int(i64::from_le_bytes(word)) }
            }
        };
        self.push(node);
        Ok(())
    }

    fn string(&mut self, opcode: u8) -> Step<()> {
        let node = match opcode {
            STRING => {
                let line = self.line_bytes()?;
                let quoted = line.len() >= 2 && line[0] == line[line.len() - 1] && matches!(line[0], b'\'' | b'"');
                let inner = line.get(1..line.len().saturating_sub(1)).filter(|_| quoted);
                let bytes = inner.and_then(unescape).ok_or("it holds a text without its quotes")?;
                self.count_decoded(bytes.len())?;
                Node::Decoded(bytes)
            }
            UNICODE => {
                let text = raw_unicode(self.line_bytes()?).ok_or("it holds a text with a broken escape")?;
                self.count_decoded(text.len())?;
                Node::Text(text)
            }
            _ => {
                let size = match opcode {
                    SHORT_BINSTRING | SHORT_BINBYTES | SHORT_BINUNICODE => usize::from(self.take(1)?[0]),
                    BINUNICODE8 | BINBYTES8 | BYTEARRAY8 => self.length(8)?,
                    _ => self.length(4)?,
                };
                let start = self.at;
                let bytes = self.take(size)?;
                if matches!(opcode, SHORT_BINUNICODE | BINUNICODE | BINUNICODE8) {
                    let text = std::str::from_utf8(bytes).map_err(|_| "it holds text that is not UTF-8")?.to_owned();
                    self.count_decoded(text.len())?;
                    Node::Text(text)
                } else {
                    Node::Bytes(start, start + size)
                }
            }
        };
        self.push(node);
        Ok(())
    }

    fn remember(&mut self, opcode: u8) -> Step<()> {
        let key = match opcode {
            GET | PUT => self.line()?.parse().map_err(|_| "it remembers under no number")?,
            BINGET | BINPUT => u64::from(self.take(1)?[0]),
            LONG_BINGET | LONG_BINPUT => self.length(4)? as u64,
            _ => self.memo.len() as u64,
        };
        if matches!(opcode, GET | BINGET | LONG_BINGET) {
            let id = *self.memo.get(&key).ok_or("it recalls what it has not stored")?;
            self.stack.push(id);
        } else {
            let top = self.top()?;
            self.memo.insert(key, top);
        }
        Ok(())
    }

    fn construct(&mut self, opcode: u8) -> Step<()> {
        let (class, arguments) = match opcode {
            BUILD => {
                let (state, object) = (self.pop()?, self.top()?);
                if let Node::Object { state: slot, .. } = &mut self.nodes[object as usize] {
                    *slot = Some(state);
                }
                return Ok(());
            }
            GLOBAL | STACK_GLOBAL => {
                let (module, name) = if opcode == GLOBAL {
                    (self.line()?.to_owned(), self.line()?.to_owned())
                } else {
                    let (name, module) = (self.pop()?, self.pop()?);
                    (self.text(module)?, self.text(name)?)
                };
                self.count_decoded(module.len() + name.len())?;
                self.push(Node::Global(module, name));
                return Ok(());
            }
            INST => {
                let global = Node::Global(self.line()?.to_owned(), self.line()?.to_owned());
                let arguments = self.pop_mark()?;
                (self.add(global), self.add(Node::Tuple(arguments)))
            }
            OBJ => {
                let mut arguments = self.pop_mark()?;
                if arguments.is_empty() {
                    return Err("it makes an object of no class".into());
                }
                let class = arguments.remove(0);
                (class, self.add(Node::Tuple(arguments)))
            }
            _ => {
                if opcode == NEWOBJ_EX {
                    self.pop()?;
                }
                let (arguments, class) = (self.pop()?, self.pop()?);
                (class, arguments)
            }
        };
        self.decode_latin1(class, arguments)?;
        self.push(Node::Object { class, arguments, state: None });
        Ok(())
    }

    /// Puts bytes in the place of the text that `_codecs.encode` would turn into them.
    fn decode_latin1(&mut self, class: Id, arguments: Id) -> Step<()> {
        let encodes = matches!(&self.nodes[class as usize], Node::Global(m, n) if m == "_codecs" && n == "encode");
        let Node::Tuple(items) = &self.nodes[arguments as usize] else { return Ok(()) };
        let Some(&first) = items.first().filter(|_| encodes) else { return Ok(()) };
        if let Node::Text(text) = &self.nodes[first as usize] {
            let bytes: Option<Vec<u8>> = text.chars().map(|c| u8::try_from(u32::from(c)).ok()).collect();
            let bytes = bytes.ok_or("it encodes text that is not Latin-1")?;
            self.count_decoded(bytes.len())?;
            let decoded = self.add(Node::Decoded(bytes));
            if let Node::Tuple(items) = &mut self.nodes[arguments as usize] {
                items[0] = decoded;
            }
        }
        Ok(())
    }

    fn collect(&mut self, opcode: u8) -> Step<()> {
        match opcode {
            EMPTY_LIST => self.push(Node::List(vec![])),
            EMPTY_DICT => self.push(Node::Dict(vec![])),
            EMPTY_TUPLE => self.push(Node::Tuple(vec![])),
            EMPTY_SET => self.push(Node::None),
            LIST | TUPLE | FROZENSET | DICT => {
                let items = self.pop_mark()?;
                self.push(match opcode {
                    LIST => Node::List(items),
                    TUPLE => Node::Tuple(items),
                    DICT => Node::Dict(pairs(&items)?),
                    _ => Node::None,
                });
            }
            TUPLE1 | TUPLE2 | TUPLE3 => {
                let count = usize::from(opcode - TUPLE1) + 1;
                let from = self.stack.len().checked_sub(count).filter(|from| *from >= self.floor());
                let items = self.stack.split_off(from.ok_or("it takes more than there is")?);
                self.push(Node::Tuple(items));
            }
            APPEND | APPENDS | ADDITEMS => {
                let items = if opcode == APPEND { vec![self.pop()?] } else { self.pop_mark()? };
                let list = self.top()?;
                self.entries += items.len();
                // Objects that grow by appending (queues, sets) are of no use here.
                if let Node::List(list) = &mut self.nodes[list as usize] {
                    list.extend(items);
                }
            }
            SETITEM | SETITEMS => {
                let items = if opcode == SETITEMS {
                    self.pop_mark()?
                } else {
                    let value = self.pop()?;
                    vec![self.pop()?, value]
                };
                let (items, dictionary) = (pairs(&items)?, self.top()?);
                self.entries += items.len();
                if let Node::Dict(pairs) = &mut self.nodes[dictionary as usize] {
                    pairs.extend(items);
                }
            }
            other => return Err(format!("its opcode {other:#04x} is not read; is it a pickle?")),
        }
        Ok(())
    }

    fn add(&mut self, node: Node) -> Id {
        self.nodes.push(node);
        // The limit on nodes is far below 2^32.
        (self.nodes.len() - 1) as Id
    }

    fn push(&mut self, node: Node) {
        let id = self.add(node);
        self.stack.push(id);
    }

    /// Where the innermost mark stands: nothing below it is popped alone.
    fn floor(&self) -> usize {
        self.marks.last().copied().unwrap_or(0)
    }

    fn pop(&mut self) -> Step<Id> {
        if self.stack.len() <= self.floor() {
            return Err("it takes more than there is".into());
        }
        self.stack.pop().ok_or_else(|| "it takes more than there is".into())
    }

    fn top(&self) -> Step<Id> {
        self.stack.last().copied().ok_or_else(|| "it takes more than there is".into())
    }

    fn pop_mark(&mut self) -> Step<Vec<Id>> {
        let mark = self.marks.pop().ok_or("it closes what it has not opened")?;
        Ok(self.stack.split_off(mark.min(self.stack.len())))
    }

    fn text(&self, id: Id) -> Step<String> {
        match &self.nodes[id as usize] {
            Node::Text(text) => Ok(text.clone()),
            _ => Err("it names a class by something that is no text".into()),
        }
    }

    fn count_decoded(&mut self, bytes: usize) -> Step<()> {
        self.decoded = self.decoded.saturating_add(bytes);
        if self.decoded > self.limits.decoded_bytes {
            return Err(format!("its texts take more than {} bytes", self.limits.decoded_bytes));
        }
        Ok(())
    }

    fn take(&mut self, count: usize) -> Step<&'a [u8]> {
        let end = self.at.checked_add(count).filter(|end| *end <= self.bytes.len());
        let end = end.ok_or("it is cut off; get the file again")?;
        let taken = &self.bytes[self.at..end];
        self.at = end;
        Ok(taken)
    }

    fn array<const N: usize>(&mut self) -> Step<[u8; N]> {
        self.take(N)?.try_into().map_err(|_| "it is cut off; get the file again".into())
    }

    /// A length of `size` bytes.
    fn length(&mut self, size: usize) -> Step<usize> {
        let word = self.take(size)?.iter().rev().fold(0u64, |word, b| (word << 8) | u64::from(*b));
        usize::try_from(word).map_err(|_| "it states a length that no memory has".into())
    }

    fn line_bytes(&mut self) -> Step<&'a [u8]> {
        let rest = &self.bytes[self.at..];
        let end = rest.iter().position(|b| *b == b'\n').ok_or("it is cut off; get the file again")?;
        self.at += end + 1;
        Ok(&rest[..end])
    }

    fn line(&mut self) -> Step<&'a str> {
        std::str::from_utf8(self.line_bytes()?).map_err(|_| "it holds a name that is no text".into())
    }
}

fn pairs(items: &[Id]) -> Step<Vec<(Id, Id)>> {
    let (pairs, rest) = items.as_chunks::<2>();
    if rest.is_empty() {
        Ok(pairs.iter().map(|[k, v]| (*k, *v)).collect())
    } else {
        Err("it holds a key without a value".into())
    }
}

#[cfg(test)]
mod tests {
    use super::super::Pickle;
    use super::*;

    fn read(bytes: &[u8]) -> Result<String, String> {
        let pickle = Pickle::read(bytes, &PickleLimits { nodes: 100_000, ..PickleLimits::default() })?;
        Ok(format!("{:?}", pickle.node(pickle.root())))
    }

    #[test]
    fn numbers_and_texts_of_all_protocols() {
        for (bytes, value) in [
            (&b"I-7\n."[..], "Int(-7)"),
            (b"I01\n.", "Bool(true)"),
            (b"L123L\n.", "Int(123)"),
            (b"\x80\x02\x8a\x01\xff.", "Int(-1)"),
            (b"\x80\x02\x8a\x09\xff\xff\xff\xff\xff\xff\xff\xff\x7f.", "BigInt"),
            (b"\x80\x02G\x3f\xf8\x00\x00\x00\x00\x00\x00.", "Float(1.5)"),
            (b"S'a\\x00\\n\\''\n.", "Decoded([97, 0, 10, 39])"),
            (b"\x80\x02U\x03abc.", "Bytes(4, 7)"),
            (b"Va\xe4\\u000a\n.", "Text(\"aä\\n\")"),
        ] {
            assert_eq!(read(bytes).unwrap(), value);
        }
    }

    #[test]
    fn hostile_pickles_end_in_a_sentence() {
        let deep = [&b"\x80\x02"[..], &b"]".repeat(1_000_000), &b"a".repeat(999_999), b"."].concat();
        let marks = [&b"("[..], &b"(".repeat(10)].concat();
        for (bytes, says) in [
            (&deep[..], "more than 100000 objects"),
            (&marks, "cut off"),
            (b"\x80\x02T\xff\xff\xff\x7fabc", "cut off"),
            (b"\x80\x02\x8e\xff\xff\xff\xff\xff\xff\xff\xff", "cut off"),
            (b"\x80\x09N.", "protocol 9"),
            (b"\x80\x02h\x07.", "not stored"),
            (b"(0.", "more than there is"),
            (b"N(R.", "more than there is"),
            (b"u.", "not opened"),
            (b"}(Nu.", "without a value"),
            (b"Pname\n.", "0x50"),
            (&[&b"]q\0N"[..], &b"0h\0h\0a".repeat(150_000)].concat(), "more than 100000 objects"),
        ] {
            let message = read(bytes).unwrap_err();
            assert!(message.contains(says), "{message}");
        }
        // A list that holds itself is data like any other.
        assert_eq!(read(b"\x80\x02]q\x00h\x00a.").unwrap(), "List([0])");
        // Deep, but within the limit: neither reading nor dropping recurses.
        let deep = [&b"]".repeat(90_000)[..], &b"a".repeat(89_999), b"."].concat();
        assert!(read(&deep).is_ok());
    }
}
