//! rosbag2's sqlite3 files: topics, messages by number, a page at a time.
//!
//! Messages that rosbag2 compressed one by one (zstd) are told by their first bytes, which no CDR message has, and unpacked. A file can make
//! SQLite compute (views, columns that are generated): its tables are plain ones, or it is refused. Format:
//! rosbag2_storage_sqlite3, schema versions 1 (Foxy) to 4 (Jazzy); columns and tables that a version lacks are taken as empty.

use std::borrow::Cow;
use std::collections::{BTreeMap, VecDeque};
use std::path::{Path, PathBuf};
use std::sync::Arc;

use rusqlite::{Connection, ErrorCode, OpenFlags};

use crate::bag::RawMessage;
use crate::rosbag2::{HASH_KEY, QOS_KEY};
use crate::{BagError, texts};

/// How a sqlite3 file begins.
pub(crate) const MAGIC: &[u8] = b"SQLite format 3\0";
/// How zstd data begin.
pub(crate) const ZSTD_MAGIC: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];
/// Messages read at once, and bytes after which no further one is: what is held in memory.
const PAGE: usize = 16;
const PAGE_BYTES: usize = 1 << 26;
/// A message is no longer than this: ten times the largest pictures and scans.
pub(crate) const MESSAGE_LIMIT: u64 = 1 << 28;

/// The messages of one file in the order of their numbers, which is the order of recording.
pub(crate) struct SqliteMessages {
    path: PathBuf,
    connection: Connection,
    channels: BTreeMap<i64, Arc<mcap::Channel<'static>>>,
    last_id: i64,
    page: VecDeque<Row>,
    given: u64,
    done: bool,
}

impl SqliteMessages {
    /// Opens a file and reads its topics; `beside` is where the bag lies, and `.msg` texts may.
    pub(crate) fn open(path: &Path, beside: &Path) -> Result<Self, BagError> {
        let failed = |error: rusqlite::Error| failure(path, 0, &error);
        let connection = Connection::open_with_flags(
            path,
            OpenFlags::SQLITE_OPEN_READ_ONLY | OpenFlags::SQLITE_OPEN_NO_MUTEX,
        )
        .map_err(failed)?;
        if let Some(why) = computed(&connection).map_err(failed)? {
            return Err(BagError::NotABag { path: path.to_owned(), why });
        }
        let channels = channels(&connection, beside).map_err(failed)?;
        Ok(Self {
            path: path.to_owned(),
            connection,
            channels,
            last_id: i64::MIN,
            page: VecDeque::new(),
            given: 0,
            done: false,
        })
    }

    /// The topics as channels.
    pub(crate) fn channels(&self) -> impl Iterator<Item = &mcap::Channel<'static>> {
        self.channels.values().map(Arc::as_ref)
    }

    fn fill(&mut self) -> Result<(), BagError> {
        let rows = page(&self.connection, self.last_id).map_err(|e| failure(&self.path, self.given, &e))?;
        for row in rows {
            // A damaged tree gives rows that it was not asked for, for ever.
            if row.0 <= self.last_id {
                if self.page.is_empty() {
                    let why = "it comes again: the file's tree is damaged".to_owned();
                    return Err(BagError::Sqlite { path: self.path.clone(), message: row.0, why });
                }
                break;
            }
            self.last_id = row.0;
            self.page.push_back(row);
        }
        Ok(())
    }

    fn message(&self, (id, topic_id, stamp_ns, data): Row) -> Result<RawMessage, BagError> {
        let refuse = |why: String| BagError::Sqlite { path: self.path.clone(), message: id, why };
        let channel = self
            .channels
            .get(&topic_id)
            .ok_or_else(|| refuse(format!("it is of topic {topic_id}, which is not declared")))?;
        let data = if data.starts_with(&ZSTD_MAGIC) { unpacked(&data).map_err(refuse)? } else { data };
        let log_time = u64::try_from(stamp_ns).map_err(|_| refuse("its time lies before 1970".to_owned()))?;
        Ok(RawMessage {
            channel: Arc::clone(channel),
            sequence: 0,
            log_time,
            publish_time: log_time,
            data: Cow::Owned(data),
        })
    }
}

impl Iterator for SqliteMessages {
    type Item = Result<RawMessage, BagError>;

    fn next(&mut self) -> Option<Self::Item> {
        if self.page.is_empty()
            && !self.done
            && let Err(error) = self.fill()
        {
            self.done = true;
            return Some(Err(error));
        }
        let message = self.page.pop_front().map(|row| self.message(row));
        match &message {
            Some(Ok(_)) => self.given += 1,
            // After an error nothing follows.
            Some(Err(_)) | None => {
                self.page.clear();
                self.done = true;
            }
        }
        message
    }
}

/// Number, topic, time and bytes of a message.
type Row = (i64, i64, i64, Vec<u8>);

fn page(connection: &Connection, after: i64) -> rusqlite::Result<Vec<Row>> {
    let sql = "SELECT id, topic_id, timestamp, data FROM messages WHERE id > ?1 ORDER BY id LIMIT ?2";
    let mut statement = connection.prepare_cached(sql)?;
    let mut rows = statement.query((after, PAGE as i64))?;
    let (mut page, mut bytes) = (Vec::new(), 0);
    let mut next = || -> rusqlite::Result<Option<Row>> {
        let Some(row) = rows.next()? else { return Ok(None) };
        Ok(Some((row.get(0)?, row.get(1)?, row.get(2)?, row.get(3)?)))
    };
    while bytes < PAGE_BYTES {
        match next() {
            Ok(Some(row)) => {
                bytes += row.3.len();
                page.push(row);
            }
            // The messages before the bad one come first; it comes again with the next page.
            Err(error) if page.is_empty() => return Err(error),
            Ok(None) | Err(_) => break,
        }
    }
    Ok(page)
}

/// Why what is read is not plain tables; none where it is.
fn computed(connection: &Connection) -> rusqlite::Result<Option<String>> {
    for table in ["topics", "messages", "message_definitions"] {
        let sql = "SELECT (SELECT count(*) FROM sqlite_schema WHERE name = ?1 COLLATE NOCASE AND (type <> 'table' OR sql LIKE 'CREATE VIRTUAL%')), \
                   (SELECT count(*) FROM pragma_table_xinfo(?1) WHERE hidden <> 0)";
        let (others, generated): (i64, i64) =
            connection.query_row(sql, (table,), |row| Ok((row.get(0)?, row.get(1)?)))?;
        if others + generated > 0 {
            return Ok(Some(format!("its `{table}` is no plain table")));
        }
    }
    Ok(None)
}

fn channels(
    connection: &Connection,
    beside: &Path,
) -> rusqlite::Result<BTreeMap<i64, Arc<mcap::Channel<'static>>>> {
    let definitions = definitions(connection)?;
    let columns = columns(connection, "topics")?;
    let optional =
        |name: &str| if columns.iter().any(|c| c == name) { name.to_owned() } else { "''".to_owned() };
    let sql = format!(
        "SELECT id, name, type, serialization_format, CAST({} AS TEXT), CAST({} AS TEXT) FROM topics ORDER BY id",
        optional("offered_qos_profiles"),
        optional("type_description_hash")
    );
    let mut statement = connection.prepare(&sql)?;
    let rows = statement.query_map((), |row| {
        let id: i64 = row.get(0)?;
        let (topic, type_name, encoding): (String, String, String) = (row.get(1)?, row.get(2)?, row.get(3)?);
        let (qos, hash): (Option<String>, Option<String>) = (row.get(4)?, row.get(5)?);
        let (encoding_of_schema, text) = definitions
            .get(&type_name)
            .cloned()
            .or_else(|| texts::find(&type_name, beside).map(|text| ("ros2msg".to_owned(), text)))
            .unwrap_or_default();
        let schema = mcap::Schema {
            id: 0,
            name: type_name,
            encoding: encoding_of_schema,
            data: Cow::Owned(text.into_bytes()),
        };
        let metadata =
            [(QOS_KEY, qos), (HASH_KEY, hash)].map(|(k, v)| (k.to_owned(), v.unwrap_or_default())).into();
        let channel = mcap::Channel {
            id: 0,
            topic,
            schema: Some(Arc::new(schema)),
            message_encoding: encoding,
            metadata,
        };
        Ok((id, Arc::new(channel)))
    })?;
    rows.collect()
}

/// Schemas by type, with their encoding; empty in files of Humble and before.
fn definitions(connection: &Connection) -> rusqlite::Result<BTreeMap<String, (String, String)>> {
    if columns(connection, "message_definitions")?.is_empty() {
        return Ok(BTreeMap::new());
    }
    let sql = "SELECT topic_type, encoding, encoded_message_definition FROM message_definitions";
    let mut statement = connection.prepare(sql)?;
    let rows = statement.query_map((), |row| {
        let (name, encoding, text): (String, String, String) = (row.get(0)?, row.get(1)?, row.get(2)?);
        Ok((name, (encoding, text)))
    })?;
    rows.filter(|row| row.as_ref().map_or(true, |(_, (_, text))| !text.is_empty())).collect()
}

/// The columns of a table; none where there is no such table.
fn columns(connection: &Connection, table: &str) -> rusqlite::Result<Vec<String>> {
    let mut statement = connection.prepare("SELECT name FROM pragma_table_info(?1)")?;
    let rows = statement.query_map((table,), |row| row.get(0))?;
    rows.collect()
}

pub(crate) fn unpacked(data: &[u8]) -> Result<Vec<u8>, String> {
    use std::io::Read as _;
    let mut bytes = Vec::new();
    zstd::Decoder::new(data)
        .and_then(|decoder| decoder.take(MESSAGE_LIMIT + 1).read_to_end(&mut bytes))
        .map_err(|error| format!("it does not decompress: {error}"))?;
    if bytes.len() as u64 > MESSAGE_LIMIT {
        return Err(format!("unpacked it is longer than {} MiB", MESSAGE_LIMIT >> 20));
    }
    Ok(bytes)
}

/// What sqlite says, in the terms of bags: a file cut short is a recording cut off.
fn failure(path: &Path, messages: u64, error: &rusqlite::Error) -> BagError {
    let cut = matches!(
        error.sqlite_error_code(),
        Some(ErrorCode::DatabaseCorrupt | ErrorCode::NotADatabase | ErrorCode::SystemIoFailure)
    );
    if cut && messages > 0 {
        let at = std::fs::metadata(path).map_or(0, |m| m.len());
        return BagError::Truncated { path: path.to_owned(), at, messages };
    }
    BagError::NotABag { path: path.to_owned(), why: format!("no whole rosbag2 sqlite3 file: {error}") }
}
