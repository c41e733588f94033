//! Changes to bytes and to JSON, the same for the same seed.

use serde_json::Value;
use stereolux_base::random;

/// Random numbers, and choices by them.
pub struct Random(u64);

impl Random {
    /// The stream of a seed.
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// 64 random bits.
    pub fn bits(&mut self) -> u64 {
        random::bits(&mut self.0)
    }

    /// A number below `count`; 0 if that is 0.
    pub fn below(&mut self, count: usize) -> usize {
        (self.bits() % count.max(1) as u64) as usize
    }

    /// One of a list that is not empty.
    pub fn pick<'a, T>(&mut self, list: &'a [T]) -> &'a T {
        &list[self.below(list.len())]
    }
}

/// Numbers at which things break.
#[rustfmt::skip]
const NUMBERS: [f64; 30] = [
    0.0, -0.0, 1.0, -1.0, 2.0, 3.0, 4.0, 0.5, 1e-30, 1e-45, 1e30, -1e30, 3.4e38, 3.5e38, -3.5e38, 1e100, 1e308,
    -1e308, 127.0, 128.0, 255.0, 256.0, 32767.0, 65535.0, 65536.0, 16_777_217.0, 2_147_483_648.0, 4_294_967_295.0,
    4_294_967_296.0, 1.8e19,
];

/// Text that means something to one of the parsers.
#[rustfmt::skip]
const WORDS: [&str; 36] = [
    "NaN", "inf", "-inf", "null", "true", "nan", "1e999", "-1", "0", "4294967296", "18446744073709551615",
    "\u{1b}[2J", "\u{9b}", "\n", "\r\n", ",", "\"", "[", "]", "{", "}", "#", "=", "../../x", "/etc/passwd",
    "data:,", "data:;base64,", "%2e%2e/", "KHR_texture_transform", "SCALAR", "MAT4", "VEC3",
    "-Y 99999999 +X 99999999", "\u{0}", "POSITION", "t_ns",
];

/// Changes bytes in one to eight places, mostly few.
pub fn bytes(bytes: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    for _ in 0..=few(8, random) {
        let at = random.below(bytes.len() + 1);
        match random.below(10) {
            0 => flip(bytes, random),
            1 if at < bytes.len() => bytes[at] = random.bits() as u8,
            2 => integer(bytes, at, random),
            3 => {
                let end = bytes.len().min(at + 1 + random.below(64));
                bytes.drain(at.min(end)..end);
            }
            4 => {
                let end = bytes.len().min(at + 1 + random.below(64));
                let part = bytes[at.min(end)..end].to_vec();
                let to = random.below(bytes.len() + 1);
                bytes.splice(to..to, part);
            }
            5 => {
                let word = *random.pick(&WORDS);
                bytes.splice(at..at, word.bytes());
            }
            6 => number(bytes, at, random),
            7 if !other.is_empty() => {
                let from = random.below(other.len());
                let part = other[from..other.len().min(from + 1 + random.below(256))].to_vec();
                let end = bytes.len().min(at + part.len());
                bytes.splice(at..end, part);
            }
            8 if random.below(8) == 0 => bytes.truncate(at),
            _ => flip(bytes, random),
        }
    }
}

fn flip(bytes: &mut [u8], random: &mut Random) {
    let at = random.below(bytes.len());
    if let Some(byte) = bytes.get_mut(at) {
        *byte ^= 1 << random.below(8);
    }
}

/// Writes a whole number or a float over what is there.
fn integer(bytes: &mut [u8], at: usize, random: &mut Random) {
    let value = *random.pick(&NUMBERS);
    let word: Vec<u8> = match random.below(6) {
        0 => (value as i64 as u16).to_le_bytes().to_vec(),
        1 => (value as i64 as u32).to_le_bytes().to_vec(),
        2 => (value as i64 as u32).to_be_bytes().to_vec(),
        3 => (value as u64).to_le_bytes().to_vec(),
        4 => (value as f32).to_le_bytes().to_vec(),
        _ => f32::NAN.to_le_bytes().to_vec(),
    };
    for (to, from) in bytes.iter_mut().skip(at).zip(word) {
        *to = from;
    }
}

/// Puts another number in the place of one that is written in digits, at or after `at`.
fn number(bytes: &mut Vec<u8>, at: usize, random: &mut Random) {
    let Some(start) = (at..bytes.len()).find(|index| bytes[*index].is_ascii_digit()) else {
        return;
    };
    let end = (start..bytes.len())
        .find(|index| !b"0123456789.eE+-".contains(&bytes[*index]))
        .unwrap_or(bytes.len());
    let text = number_text(random);
    bytes.splice(start..end, text.bytes());
}

fn number_text(random: &mut Random) -> String {
    let value = *random.pick(&NUMBERS);
    match random.below(4) {
        0 => format!("{}", value as i64),
        1 => format!("{value:e}"),
        2 => format!("{}", random.below(1 << 20)),
        _ => format!("{value}"),
    }
}

/// A number below `most`, small ones more often.
fn few(most: usize, random: &mut Random) -> usize {
    let bound = 1 + random.below(most);
    random.below(bound)
}

/// Changes JSON in one to four places, mostly few, and keeps it JSON.
pub fn json(root: &mut Value, random: &mut Random) {
    for _ in 0..=few(4, random) {
        let copy = place(root, random).clone();
        let target = place(root, random);
        match random.below(8) {
            0 => *target = Value::Null,
            1 => *target = Value::from((*random.pick(&WORDS)).to_owned()),
            2 => *target = copy,
            3 => *target = Value::Array(vec![target.clone(); random.below(4)]),
            4 => {
                if let Value::Array(list) = target {
                    let at = random.below(list.len());
                    if random.below(2) == 0 && at < list.len() {
                        list.remove(at);
                    } else {
                        list.push(copy);
                    }
                } else if let Value::Object(members) = target {
                    let keys: Vec<String> = members.keys().cloned().collect();
                    if let Some(key) = keys.get(random.below(keys.len())) {
                        members.remove(key);
                    }
                }
            }
            _ => {
                *target = match random.below(3) {
                    0 => Value::from(random.below(16)),
                    1 => Value::from(*random.pick(&NUMBERS) as i64),
                    _ => Value::from(*random.pick(&NUMBERS)),
                };
            }
        }
    }
}

/// A value somewhere in the tree.
fn place<'a>(mut at: &'a mut Value, random: &mut Random) -> &'a mut Value {
    loop {
        let count = match &*at {
            Value::Array(list) => list.len(),
            Value::Object(members) => members.len(),
            _ => 0,
        };
        if count == 0 || random.below(6) == 0 {
            return at;
        }
        let index = random.below(count);
        at = match at {
            Value::Array(list) => &mut list[index],
            Value::Object(members) => match members.values_mut().nth(index) {
                Some(member) => member,
                None => unreachable!("counted above"),
            },
            other => return other,
        };
    }
}
