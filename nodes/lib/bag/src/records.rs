//! Walks through the records of one MCAP file, chunks unpacked, without trusting a length in it.
//!
//! Nothing is reserved for a length before its bytes are there, one compressed chunk and one record are held at a time, and every
//! error names the byte. Format: <https://mcap.dev/spec>.

use std::fs::File;
use std::io::{self, BufReader, Cursor, Read, Seek, SeekFrom};
use std::path::{Path, PathBuf};

use mcap::records::{Record, op};

use crate::BagError;
use crate::sqlite::MESSAGE_LIMIT;

/// Longer records than this are taken for damage; in a chunk, longer ones than a message: few bytes there may unpack to many.
const RECORD_LIMIT: u64 = 1 << 30;
/// Opcode and length.
const HEAD_LEN: u64 = 9;

/// What reading one record gave.
enum Step {
    Record(u8),
    /// The source ends before the record does; what is there of the body is in the buffer.
    Cut(u8),
    TooLong(u64),
    End,
}

/// Whether the texts of a header, schema or channel are as long as they say: the parser asks for that much memory before it looks.
fn texts_fit(opcode: u8, body: &[u8]) -> Option<()> {
    fn text<'a>(rest: &mut &'a [u8]) -> Option<&'a [u8]> {
        let (len, tail) = rest.split_first_chunk::<4>()?;
        let (text, tail) = tail.split_at_checked(u32::from_le_bytes(*len) as usize)?;
        *rest = tail;
        Some(text)
    }
    let ids = match opcode {
        op::HEADER => 0,
        op::SCHEMA => 2,
        op::CHANNEL => 4,
        _ => return Some(()),
    };
    let mut rest = body.get(ids..)?;
    text(&mut rest)?;
    text(&mut rest)?;
    if opcode == op::CHANNEL {
        let mut pairs = text(&mut rest)?;
        while !pairs.is_empty() {
            text(&mut pairs)?;
        }
    }
    Some(())
}

/// Reads the next record's body, of at most so many bytes, into `body`.
fn step(source: &mut impl Read, body: &mut Vec<u8>, most: u64) -> io::Result<Step> {
    body.clear();
    source.by_ref().take(HEAD_LEN).read_to_end(body)?;
    let Some((&opcode, len)) = body.split_first() else { return Ok(Step::End) };
    let len = <[u8; 8]>::try_from(len).map(u64::from_le_bytes);
    body.clear();
    match len {
        Err(_) => Ok(Step::Cut(opcode)),
        Ok(len) if len > most => Ok(Step::TooLong(len)),
        Ok(len) => {
            source.by_ref().take(len).read_to_end(body)?;
            Ok(if body.len() as u64 == len { Step::Record(opcode) } else { Step::Cut(opcode) })
        }
    }
}

/// The chunk being unpacked.
struct Chunk {
    records: BufReader<HashingRead>,
    expected_crc: u32,
    /// Whether the file ends inside it.
    cut: bool,
}

/// Decompressed bytes on their way, hashed as they pass.
struct HashingRead {
    inner: Box<dyn Read + Send>,
    crc: crc32fast::Hasher,
}

impl Read for HashingRead {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        let n = self.inner.read(buffer)?;
        self.crc.update(&buffer[..n]);
        Ok(n)
    }
}

/// The records of one file in file order. After an error nothing follows.
pub(crate) struct Records {
    path: PathBuf,
    file: BufReader<File>,
    /// Offset of the file's record being read.
    at: u64,
    /// Offset of the file's record after it.
    next_at: u64,
    chunk: Option<Chunk>,
    body: Vec<u8>,
    done: bool,
    messages: u64,
}

impl Records {
    /// Opens a file and checks its magic bytes.
    pub(crate) fn open(path: &Path) -> Result<Self, BagError> {
        let mut file = BufReader::new(File::open(path).map_err(BagError::io(path))?);
        let mut magic = Vec::new();
        let magic_len = mcap::MAGIC.len() as u64;
        file.by_ref().take(magic_len).read_to_end(&mut magic).map_err(BagError::io(path))?;
        if magic != mcap::MAGIC {
            let why =
                if magic.is_empty() { "the file is empty" } else { "it does not begin as an MCAP file does" };
            return Err(BagError::NotABag { path: path.to_owned(), why: why.to_owned() });
        }
        Ok(Self {
            path: path.to_owned(),
            file,
            at: 0,
            next_at: magic_len,
            chunk: None,
            body: Vec::new(),
            done: false,
            messages: 0,
        })
    }

    /// Goes to the summary section, where the file ends with a footer that names one.
    pub(crate) fn seek_summary(&mut self) -> Result<bool, BagError> {
        let tail_len = HEAD_LEN + 20 + mcap::MAGIC.len() as u64;
        let io_error = BagError::io(&self.path);
        let file_len = self.file.get_ref().metadata().map_err(io_error)?.len();
        if file_len < tail_len {
            return Ok(false);
        }
        self.seek(file_len - tail_len)?;
        match step(&mut self.file, &mut self.body, RECORD_LIMIT) {
            Ok(Step::Record(op::FOOTER)) => {}
            _ => return Ok(false),
        }
        match mcap::parse_record(op::FOOTER, &self.body) {
            Ok(Record::Footer(footer)) if (1..file_len).contains(&footer.summary_start) => {
                self.seek(footer.summary_start)?;
                Ok(true)
            }
            _ => Ok(false),
        }
    }

    fn seek(&mut self, at: u64) -> Result<(), BagError> {
        self.file.seek(SeekFrom::Start(at)).map_err(BagError::io(&self.path))?;
        self.next_at = at;
        Ok(())
    }

    /// The next record that matters here (header, schema, channel, message, footer). The footer is the last.
    pub(crate) fn next(&mut self) -> Option<Result<Record<'_>, BagError>> {
        if self.done {
            return None;
        }
        match self.advance() {
            Ok(opcode) => {
                self.done = opcode == op::FOOTER;
                self.messages += u64::from(opcode == op::MESSAGE);
                if texts_fit(opcode, &self.body).is_none() {
                    return Some(Err(self.damaged("a text in it is longer than the record")));
                }
                let parsed = mcap::parse_record(opcode, &self.body);
                self.done |= parsed.is_err();
                let damaged = |e: mcap::McapError| BagError::Damaged {
                    path: self.path.clone(),
                    at: self.at,
                    why: e.to_string(),
                };
                Some(parsed.map_err(damaged))
            }
            Err(error) => {
                self.done = true;
                Some(Err(error))
            }
        }
    }

    /// Says what is wrong with the record just read, and ends the walk.
    pub(crate) fn damaged(&mut self, why: impl Into<String>) -> BagError {
        self.done = true;
        BagError::Damaged { path: self.path.clone(), at: self.at, why: why.into() }
    }

    /// Puts the next record that matters into `body`; gives its opcode.
    fn advance(&mut self) -> Result<u8, BagError> {
        loop {
            let opcode = match self.chunk.take() {
                Some(chunk) => self.advance_in_chunk(chunk)?,
                None => Some(self.advance_in_file()?),
            };
            if let Some(matters @ (op::HEADER | op::SCHEMA | op::CHANNEL | op::MESSAGE | op::FOOTER)) = opcode
            {
                return Ok(matters);
            }
        }
    }

    fn advance_in_file(&mut self) -> Result<u8, BagError> {
        self.at = self.next_at;
        match step(&mut self.file, &mut self.body, RECORD_LIMIT).map_err(BagError::io(&self.path))? {
            Step::Record(opcode) => {
                self.next_at += HEAD_LEN + self.body.len() as u64;
                if opcode == op::CHUNK {
                    self.chunk = Some(self.enter_chunk(false)?);
                }
                Ok(opcode)
            }
            // What is there of a chunk may hold whole messages.
            Step::Cut(op::CHUNK) => {
                self.chunk = Some(self.enter_chunk(true)?);
                Ok(op::CHUNK)
            }
            Step::Cut(_) | Step::End => Err(self.truncated()),
            Step::TooLong(len) => Err(self.too_long(len)),
        }
    }

    /// Makes `body`, a chunk's record, the source of records.
    fn enter_chunk(&mut self, cut: bool) -> Result<Chunk, BagError> {
        let Some(header) = ChunkHeader::parse(&self.body) else {
            return Err(if cut { self.truncated() } else { self.damaged("the chunk's header is not whole") });
        };
        let ChunkHeader { uncompressed_len, expected_crc, compression, compressed_len, data_at } = header;
        let held = (self.body.len() - data_at) as u64;
        if compressed_len > held && !cut {
            return Err(self.damaged(format!("a chunk of {compressed_len} bytes in a record of {held}")));
        }
        let mut data = Cursor::new(std::mem::take(&mut self.body));
        data.set_position(data_at as u64);
        let data = data.take(compressed_len);
        let io_error = BagError::io(&self.path);
        let records: Box<dyn Read + Send> = match compression.as_str() {
            "" => Box::new(data),
            "zstd" => Box::new(zstd::Decoder::new(data).map_err(io_error)?),
            "lz4" => Box::new(lz4::Decoder::new(data).map_err(io_error)?),
            _ => return Err(BagError::Compression { path: self.path.clone(), at: self.at, compression }),
        };
        let inner: Box<dyn Read + Send> = Box::new(records.take(uncompressed_len));
        let records = BufReader::new(HashingRead { inner, crc: crc32fast::Hasher::new() });
        Ok(Chunk { records, expected_crc, cut })
    }

    /// The next record of the chunk, which stays the source of records while there is one.
    fn advance_in_chunk(&mut self, mut chunk: Chunk) -> Result<Option<u8>, BagError> {
        match step(&mut chunk.records, &mut self.body, MESSAGE_LIMIT) {
            Ok(Step::Record(op::CHUNK | op::FOOTER)) => {
                Err(self.damaged("a chunk holds a chunk or a footer"))
            }
            Ok(Step::Record(opcode)) => {
                self.chunk = Some(chunk);
                Ok(Some(opcode))
            }
            _ if chunk.cut => Err(self.truncated()),
            Ok(Step::End) => {
                let found = chunk.records.into_inner().crc.finalize();
                if chunk.expected_crc != 0 && chunk.expected_crc != found {
                    let expected = chunk.expected_crc;
                    return Err(
                        self.damaged(format!("the chunk's checksum is {found:08x}, not {expected:08x}"))
                    );
                }
                Ok(None)
            }
            Ok(Step::Cut(_)) => Err(self.damaged("a record is longer than the chunk it is in")),
            Ok(Step::TooLong(len)) => Err(self.too_long(len)),
            Err(error) => Err(self.damaged(format!("the chunk does not decompress: {error}"))),
        }
    }

    fn truncated(&self) -> BagError {
        BagError::Truncated { path: self.path.clone(), at: self.at, messages: self.messages }
    }

    fn too_long(&mut self, len: u64) -> BagError {
        self.damaged(format!("a record of {len} bytes, which is too long"))
    }
}

/// The fields of a chunk's record before its data.
struct ChunkHeader {
    uncompressed_len: u64,
    expected_crc: u32,
    compression: String,
    compressed_len: u64,
    /// Where in the record the data begin.
    data_at: usize,
}

impl ChunkHeader {
    /// By hand, because the crate's parser refuses a chunk that is not whole.
    fn parse(record: &[u8]) -> Option<Self> {
        let (_times, rest) = record.split_at_checked(16)?;
        let (uncompressed_len, rest) = rest.split_first_chunk()?;
        let (expected_crc, rest) = rest.split_first_chunk()?;
        let (name_len, rest) = rest.split_first_chunk()?;
        let (name, rest) = rest.split_at_checked(u32::from_le_bytes(*name_len) as usize)?;
        let (compressed_len, data) = rest.split_first_chunk()?;
        Some(Self {
            uncompressed_len: u64::from_le_bytes(*uncompressed_len),
            expected_crc: u32::from_le_bytes(*expected_crc),
            compression: String::from_utf8_lossy(name).into_owned(),
            compressed_len: u64::from_le_bytes(*compressed_len),
            data_at: record.len() - data.len(),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::{op, texts_fit};

    /// Found by fuzzing: 3.7 GB were asked for.
    #[test]
    fn a_text_longer_than_its_record_is_told_before_memory_is_asked_for() {
        let text = |text: &str| [&(text.len() as u32).to_le_bytes(), text.as_bytes()].concat();
        let channel = [&[1, 0, 1, 0][..], &text("/odom"), &text("cdr"), &text("")].concat();
        assert!(texts_fit(op::CHANNEL, &channel).is_some());
        for place in [4, 4 + 4 + 5, channel.len() - 4] {
            let mut long = channel.clone();
            long[place + 3] = 0xdf;
            assert!(texts_fit(op::CHANNEL, &long).is_none(), "{place}");
        }
        assert!(texts_fit(op::HEADER, &[0xff; 8]).is_none() && texts_fit(op::MESSAGE, &[]).is_some());
    }
}
