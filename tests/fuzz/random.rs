//! Random numbers and the damage that is done to inputs of all kinds. The same seed, kind and case give the same input everywhere.

use toml::{Table, Value};

use crate::common::random::Random as Generator;

/// Random numbers with one word of state, so that a case needs none of those before it.
#[derive(Debug, Clone)]
pub struct Random(Generator);

/// Numbers that programs stumble over, as texts; some are numbers of one format only, or none.
const NUMBERS: [&str; 44] = [
    "0",
    "-0.0",
    "1",
    "-1",
    "2",
    "0.5",
    "1e-3",
    "1e3",
    "1e6",
    "1e9",
    "1e15",
    "1e16",
    "-1e9",
    "1e30",
    "1e100",
    "1e150",
    "1e155",
    "-1e200",
    "1e300",
    "1e307",
    "1e308",
    "-1e308",
    "1.7976931348623157e308",
    "1e-9",
    "1e-30",
    "1e-155",
    "1e-300",
    "1e-308",
    "5e-324",
    "nan",
    "-nan",
    "NaN",
    "inf",
    "-inf",
    "1e999",
    "255",
    "65536",
    "2147483648",
    "4294967296",
    "9007199254740993",
    "9223372036854775807",
    "-9223372036854775808",
    "18446744073709551616",
    "0x7fffffffffffffff",
];

/// Pieces of text that are no numbers.
const PIECES: [&str; 34] = [
    "",
    " ",
    "\n",
    "\r\n",
    "\t",
    "\0",
    "\u{1}",
    "\u{7f}",
    "\u{feff}",
    "\u{202e}",
    "é",
    "日本",
    "🦀",
    "\"",
    "'",
    "\"\"\"",
    "=",
    ",",
    ";",
    "[",
    "]",
    "[[",
    "{",
    "}",
    "#",
    "<",
    ">",
    "&",
    "--",
    "&&",
    "true",
    "1979-05-27T07:32:00Z",
    "..",
    "%s%n",
];

impl Random {
    /// The random numbers of one case.
    pub fn new(seed: u64, kind: &str, case: u64) -> Self {
        let name = kind.bytes().fold(0xcbf2_9ce4_8422_2325_u64, |hash, b| (hash ^ u64::from(b)).wrapping_mul(0x100_0000_01b3));
        let start = Generator::new(seed ^ name).next() ^ case;
        Self(Generator::new(start))
    }

    pub fn next(&mut self) -> u64 {
        self.0.next()
    }

    /// A whole number below `n`, which is at least 1.
    pub fn below(&mut self, n: usize) -> usize {
        (self.next() % n as u64) as usize
    }

    /// True once in `n` times.
    pub fn once_in(&mut self, n: usize) -> bool {
        self.below(n) == 0
    }

    pub fn pick<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len())]
    }

    /// A number from `low` to `high`.
    pub fn between(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * (self.next() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A number whose logarithm is spread evenly from that of `low` to that of `high`.
    pub fn scale(&mut self, low: f64, high: f64) -> f64 {
        self.between(low.ln(), high.ln()).exp()
    }

    /// `value`, or once in a while some powers of ten away from it.
    pub fn wild(&mut self, value: f64) -> f64 {
        if self.once_in(40) { value * 10_f64.powi(self.below(25) as i32 - 12) } else { value }
    }

    /// The text of a number, extreme more often than not.
    pub fn number(&mut self) -> String {
        match self.below(12) {
            0 => "9".repeat(1 + self.below(400)),
            1 => format!("0.{}1", "0".repeat(self.below(400))),
            2 => format!("{}", self.below(20)),
            3 => format!("{}", f64::from_bits(self.next())),
            _ => (*self.pick(&NUMBERS)).to_owned(),
        }
    }

    fn piece(&mut self) -> String {
        match self.below(12) {
            0 => self.pick(&["[", "{", "(", "<a>", "[[", "a."]).repeat(1 + self.below(2000)),
            1 => self.pick(&["a", "é", "0", "\""]).repeat(1 + self.below(3000)),
            2..=5 => self.number(),
            _ => (*self.pick(&PIECES)).to_owned(),
        }
    }

    /// Damages bytes in one to four places: bits, pieces cut out, doubled or put in, numbers and words exchanged.
    pub fn damage(&mut self, bytes: &mut Vec<u8>) {
        for _ in 0..1 + self.below(4) / 2 + usize::from(self.once_in(4)) {
            self.damage_once(bytes);
        }
    }

    fn damage_once(&mut self, bytes: &mut Vec<u8>) {
        if bytes.is_empty() {
            bytes.extend(self.piece().bytes());
            return;
        }
        let at = self.below(bytes.len());
        let span = |random: &mut Self, most: usize| at..(at + 1 + random.below(most)).min(bytes.len());
        match self.below(13) {
            0 => bytes[at] ^= 1 << self.below(8),
            1 => bytes[at] = self.next() as u8,
            2 => bytes.truncate(at),
            3 => drop(bytes.drain(span(self, 40))),
            4 => {
                let copy = bytes[span(self, 200)].to_vec();
                let to = self.below(bytes.len() + 1);
                bytes.splice(to..to, copy);
            }
            5 => drop(bytes.splice(at..at, self.piece().into_bytes())),
            6 | 7 => {
                let line = line_at(bytes, at);
                let copy = bytes[line.clone()].to_vec();
                if self.once_in(2) {
                    bytes.splice(line.end..line.end, copy);
                } else {
                    bytes.drain(line);
                }
            }
            8..=10 => {
                if let Some(word) = word_near(bytes, at, |b| b.is_ascii_digit() || b"+-.eE".contains(&b)) {
                    let number = self.number();
                    bytes.splice(word, number.into_bytes());
                }
            }
            _ => {
                let letter = |b: u8| b.is_ascii_alphanumeric() || b"_-.".contains(&b);
                let other = self.below(bytes.len());
                if let (Some(to), Some(from)) = (word_near(bytes, at, letter), word_near(bytes, other, letter)) {
                    let word = bytes[from].to_vec();
                    bytes.splice(to, word);
                }
            }
        }
    }

    /// Changes one or two places of a table: values become extreme, of another type or longer, keys vanish or get other names.
    pub fn damage_table(&mut self, table: &mut Table) {
        for _ in 0..1 + usize::from(self.once_in(3)) {
            let count = places(table);
            let target = self.below(count.max(1));
            let mut at = 0;
            self.change_in_table(table, target, &mut at);
        }
    }

    /// A text of the table, at times damaged once more as a text.
    pub fn table_text(&mut self, table: &Table) -> Vec<u8> {
        let mut text = toml::to_string(table).unwrap_or_default().into_bytes();
        if self.once_in(8) {
            self.damage(&mut text);
        }
        text
    }

    fn change_in_table(&mut self, table: &mut Table, target: usize, at: &mut usize) {
        let keys: Vec<String> = table.keys().cloned().collect();
        for key in keys {
            if *at == target {
                *at += 1;
                match self.below(8) {
                    0 => drop(table.remove(&key)),
                    1 => {
                        if let Some(value) = table.remove(&key) {
                            let name = self.piece();
                            table.insert(name, value);
                        }
                    }
                    _ => {
                        let old = table.get(&key).cloned();
                        let new = self.other_value(old);
                        table.insert(key, new);
                    }
                }
                return;
            }
            *at += 1;
            if let Some(value) = table.get_mut(&key) {
                self.change_in_value(value, target, at);
            }
        }
    }

    fn change_in_value(&mut self, value: &mut Value, target: usize, at: &mut usize) {
        match value {
            Value::Table(inner) => self.change_in_table(inner, target, at),
            Value::Array(list) => {
                for item in list {
                    if *at == target {
                        *item = self.other_value(Some(item.clone()));
                    }
                    *at += 1;
                    self.change_in_value(item, target, at);
                }
            }
            _ => {}
        }
    }

    fn other_value(&mut self, old: Option<Value>) -> Value {
        let number = |random: &mut Self| {
            let text = random.number();
            let whole = text.parse::<i64>().ok().map(Value::Integer);
            whole.or_else(|| text.parse().ok().map(Value::Float)).unwrap_or(Value::String(text))
        };
        match (self.below(10), old) {
            (0, Some(Value::Array(mut list))) if !list.is_empty() => {
                let item = list[self.below(list.len())].clone();
                let count = *self.pick(&[1, 2, 7, 5000]);
                list.extend(std::iter::repeat_n(item, count));
                Value::Array(list)
            }
            (1, Some(Value::Array(mut list))) => {
                list.truncate(self.below(list.len() + 1));
                Value::Array(list)
            }
            (0, _) => Value::String(self.piece()),
            (1, _) => Value::Boolean(self.once_in(2)),
            (2, _) => Value::Array(vec![number(self); self.below(9)]),
            (3, _) => Value::Table(Table::from_iter([(self.piece(), number(self))])),
            (4, _) => (0..self.below(200)).fold(number(self), |inner, _| Value::Array(vec![inner])),
            (5, Some(Value::Float(value))) => Value::Float(value * 10_f64.powi(self.below(41) as i32 - 20)),
            (5, Some(Value::Integer(value))) => Value::Integer(value.wrapping_mul(10_i64.pow(self.below(19) as u32))),
            _ => number(self),
        }
    }
}

fn places(table: &Table) -> usize {
    fn of(value: &Value) -> usize {
        match value {
            Value::Table(table) => places(table),
            Value::Array(list) => list.iter().map(|item| 1 + of(item)).sum(),
            _ => 0,
        }
    }
    table.values().map(|value| 1 + of(value)).sum()
}

fn line_at(bytes: &[u8], at: usize) -> std::ops::Range<usize> {
    let start = bytes[..at].iter().rposition(|&b| b == b'\n').map_or(0, |end| end + 1);
    let end = bytes[at..].iter().position(|&b| b == b'\n').map_or(bytes.len(), |end| at + end + 1);
    start..end
}

/// The run of such bytes at or behind `at`.
fn word_near(bytes: &[u8], at: usize, belongs: impl Fn(u8) -> bool) -> Option<std::ops::Range<usize>> {
    let inside = at + bytes[at..].iter().position(|&b| belongs(b))?;
    let start = bytes[..inside].iter().rposition(|&b| !belongs(b)).map_or(0, |end| end + 1);
    let end = bytes[inside..].iter().position(|&b| !belongs(b)).map_or(bytes.len(), |end| inside + end);
    Some(start..end)
}
