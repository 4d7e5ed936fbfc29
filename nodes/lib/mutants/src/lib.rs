//! Damaged files and datagrams for tests, the same in every run.
//!
//! What reads a file from outside is handed thousands of them: each must be answered, soon, in bounded memory, and an error must name the file.

/// What stands where a number stood: the ends of the number types, what is none, and other things.
const NUMBERS: [&str; 16] = [
    "0",
    "-1",
    "1e308",
    "-1e308",
    "1e-320",
    "1e999",
    "18446744073709551615",
    "-9223372036854775809",
    "4294967296",
    "1e18",
    "0.0",
    "NaN",
    ".inf",
    "null",
    "\"x\"",
    "[]",
];
/// Marks of JSON and YAML.
const MARKS: &[u8] = b"{}[]:&*!|>-'\"\n\t #%@,?0e.~\\";

/// Draws from a seed (xorshift).
#[derive(Debug, Clone)]
pub struct Mutants(u64);

impl Mutants {
    /// A sequence that is the same in every run; the seed must not be 0.
    #[must_use]
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// As many as a test makes: `usual`, times the environment's `GRIPSIGHT_MUTANTS` where a campaign asks for more.
    #[must_use]
    pub fn count(usual: usize) -> usize {
        let factor = std::env::var("GRIPSIGHT_MUTANTS").ok().and_then(|factor| factor.parse().ok());
        usual * factor.unwrap_or(1)
    }

    /// A number below `end`, which is at least 1.
    pub fn below(&mut self, end: usize) -> usize {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        (self.0 >> 11) as usize % end
    }

    /// Any byte.
    pub fn byte(&mut self) -> u8 {
        self.below(256) as u8
    }

    /// A text file with up to six faults: other marks, numbers at the ends of what numbers can be, parts lost, doubled or strange, the end cut off.
    pub fn text(&mut self, file: &str) -> String {
        let mut bytes = file.as_bytes().to_vec();
        for _ in 0..=self.below(6) {
            if bytes.is_empty() {
                break;
            }
            let at = self.below(bytes.len());
            match self.below(16) {
                0..3 => bytes[at] = MARKS[self.below(MARKS.len())],
                3 => bytes.insert(at, self.byte()),
                4..12 => self.number(&mut bytes, at),
                _ => self.part(&mut bytes, at),
            }
        }
        String::from_utf8_lossy(&bytes).into_owned()
    }

    /// A file of any kind with up to six faults between `from` and `to`: other bytes, parts lost or doubled, the end cut off.
    pub fn binary(&mut self, file: &[u8], from: usize, to: usize) -> Vec<u8> {
        let mut bytes = file.to_vec();
        for _ in 0..=self.below(6) {
            if bytes.len() <= from {
                break;
            }
            let at = from + self.below(to.min(bytes.len()) - from);
            match self.below(8) {
                0..3 => bytes[at] = self.byte(),
                3 => bytes[at] ^= 1 << self.below(8),
                4 => bytes[at] = [0, 0x7f, 0x80, 0xff][self.below(4)],
                5 => bytes.insert(at, self.byte()),
                _ => self.part(&mut bytes, at),
            }
        }
        bytes
    }

    /// Another length somewhere: four or eight bytes, the low one first.
    pub fn length(&mut self, bytes: &mut [u8]) {
        const LENGTHS: [u64; 8] = [0, 1, 255, 1 << 20, 1 << 31, u32::MAX as u64, 1 << 40, u64::MAX];
        let size = [4, 8][self.below(2)];
        if bytes.len() >= size {
            let at = self.below(bytes.len() - size + 1);
            let length = LENGTHS[self.below(LENGTHS.len())];
            bytes[at..at + size].copy_from_slice(&length.to_le_bytes()[..size]);
        }
    }

    /// Another number in place of the next one.
    fn number(&mut self, bytes: &mut Vec<u8>, at: usize) {
        let is_of_number = |byte: &u8| byte.is_ascii_digit() || b"+-.eE".contains(byte);
        let Some(start) = bytes[at..].iter().position(u8::is_ascii_digit).map(|found| at + found) else {
            return;
        };
        let start =
            bytes[..start].iter().rposition(|byte| !is_of_number(byte)).map_or(0, |before| before + 1);
        let length =
            bytes[start..].iter().position(|byte| !is_of_number(byte)).unwrap_or(bytes.len() - start);
        let other = NUMBERS[self.below(NUMBERS.len())];
        bytes.splice(start..start + length, other.bytes());
    }

    /// Loses a part, doubles one, or cuts off what follows.
    fn part(&mut self, bytes: &mut Vec<u8>, at: usize) {
        let end = (at + 1 + self.below(60)).min(bytes.len());
        match self.below(5) {
            0 | 1 => drop(bytes.drain(at..end)),
            2 | 3 => bytes.extend_from_within(at..end),
            _ => bytes.truncate(at),
        }
    }
}

/// Text that a reader by recursion, or one that expands what it refers to, dies of.
#[must_use]
pub fn bombs() -> Vec<String> {
    let aliases: String =
        (1..30).map(|n| format!("a{n}: &a{n} [*a{m}, *a{m}, *a{m}, *a{m}]\n", m = n - 1)).collect();
    vec![
        "[".repeat(200_000),
        "? ".repeat(100_000),
        "{a: ".repeat(100_000),
        "{\"a\":".repeat(100_000),
        format!("a0: &a0 x\n{aliases}"),
        "9".repeat(1_000_000),
    ]
}

/// The most memory that this process has held so far, MB; none where the system does not tell.
#[must_use]
pub fn peak_memory_mb() -> Option<f64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let peak = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    peak.trim().trim_end_matches(" kB").parse::<f64>().ok().map(|kb| kb / 1e3)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_seed_gives_the_same_mutants_and_few_are_the_file_itself() {
        let file = "{\"a\": 1.5, \"b\": [2, 3]}";
        let (mut first, mut second) = (Mutants::new(7), Mutants::new(7));
        let made: Vec<String> = (0..1000).map(|_| first.text(file)).collect();
        assert!(made.iter().all(|text| *text == second.text(file)));
        assert!(made.iter().filter(|text| *text == file).count() < 50);
        assert!(made.iter().any(|text| text.contains("1e308")));
        let made = first.binary(&[7; 100], 50, 60);
        assert_eq!(made[..50], [7; 50]);
        let mut lengths = [7; 100];
        first.length(&mut lengths);
        assert_eq!(lengths.iter().filter(|byte| **byte != 7).count() % 4, 0);
    }
}
