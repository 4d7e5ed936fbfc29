//! Whatever the bytes, the answer is a result: nothing panics, hangs, or asks for more memory than the file is worth.

use std::fs;
use std::path::Path;
use std::sync::OnceLock;
use std::time::Instant;

use gripsight_bag::dynamic::{Reader, Schema};
use gripsight_bag::{
    Bag, BagError, Reassembler, TopicMap, decode, from_cdr, info, propose, read_sequences, recover, to_cdr,
};
use gripsight_msgs::standard::{
    ackermann_msgs, builtin_interfaces, diagnostic_msgs, geometry_msgs, nav_msgs, rcl_interfaces,
    rosgraph_msgs, sensor_msgs, std_msgs,
};
use gripsight_msgs::{Message, schema};
use gripsight_mutants::{Mutants, bombs, peak_memory_mb};
use proptest::prelude::*;
use rusqlite::Connection;
use tempfile::TempDir;

use crate::sqlite::{standard, write};
use crate::support::{Channel, WHOLE, file, mcap_bytes, telemetry_bag};

/// What a test may hold (MB): a message may be 256 MB long, and is read and handed on.
const MOST_MB: f64 = 700.0;

/// Mutants of files, each read by `read`, which says whether it took it.
fn assert_answered(name: &str, usual: usize, files: &[Vec<u8>], read: impl Fn(&[u8]) -> bool) {
    let (mut mutants, mut refused, mut longest_s) = (Mutants::new(0xbad_ba6), 0, 0.0_f64);
    let (count, start) = (Mutants::count(usual), Instant::now());
    for k in 0..count {
        let mut bytes = mutants.binary(&files[k % files.len()], 0, usize::MAX);
        for _ in 0..mutants.below(3) {
            mutants.length(&mut bytes);
        }
        let begin = Instant::now();
        refused += usize::from(!read(&bytes));
        longest_s = longest_s.max(begin.elapsed().as_secs_f64());
    }
    let took_s = start.elapsed().as_secs_f64();
    let held_mb = peak_memory_mb();
    println!(
        "{name}: {count} mutants in {took_s:.1} s, at most {longest_s:.2} s, {refused} refused, held at most {held_mb:?} MB"
    );
    assert!(refused < count, "all of {count} refused");
    assert!(longest_s < 20.0, "{longest_s} s");
    assert!(held_mb.is_none_or(|held_mb| held_mb < MOST_MB), "{held_mb:?} MB");
}

/// A few small bags, by kind of chunk.
fn seeds() -> &'static [Vec<u8>] {
    static SEEDS: OnceLock<Vec<Vec<u8>>> = OnceLock::new();
    SEEDS.get_or_init(|| {
        let folder = TempDir::new().unwrap();
        let options = mcap::WriteOptions::new;
        let channels = [Channel::odom(), Channel::drive()];
        let mut seeds = vec![fs::read(telemetry_bag(&folder.path().join("a.mcap"), 20)).unwrap()];
        for options in [
            options().compression(None),
            options().compression(None).calculate_chunk_crcs(false),
            options().calculate_chunk_crcs(false),
            options().compression(Some(mcap::Compression::Lz4)).calculate_chunk_crcs(false),
            options().use_chunks(false),
        ] {
            seeds.push(mcap_bytes("ros2", options, &channels));
        }
        seeds
    })
}

/// Everything that reads a bag; whether each of this one's messages was there.
fn read_all(path: &Path, out: &Path) -> bool {
    let length = fs::metadata(path).unwrap().len() as usize;
    let mut takes = false;
    if let Ok(bag) = Bag::open(path) {
        let read = bag.messages().filter(Result::is_ok).count();
        assert!(read <= length * 1000);
        takes = bag.messages().all(|message| message.is_ok());
    }
    for refusal in [
        read_sequences(path, &TopicMap::default(), WHOLE).err(),
        info(path, &TopicMap::default()).err(),
        propose(path).err(),
        recover(path, out).err(),
    ]
    .into_iter()
    .flatten()
    {
        let text = refusal.to_string();
        assert!(text.len() < 4000, "{} bytes of text: {text:.200}", text.len());
    }
    takes
}

#[test]
fn a_mutated_mcap_file_is_answered() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("bag.mcap");
    assert_answered("MCAP", 1000, seeds(), |bytes| {
        fs::write(&path, bytes).unwrap();
        read_all(&path, &folder.path().join("out.mcap"))
    });
}

#[test]
fn a_mutated_sqlite_file_is_answered() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    let texts = [
        ("nav_msgs/msg/Odometry", schema("nav_msgs/msg/Odometry").unwrap()),
        (
            "ackermann_msgs/msg/AckermannDriveStamped",
            schema("ackermann_msgs/msg/AckermannDriveStamped").unwrap(),
        ),
    ];
    let texts = texts.each_ref().map(|(name, text)| (*name, text.as_str()));
    let plain = fs::read(write(&at("plain.db3"), &standard(20), false, &texts)).unwrap();
    let packed = fs::read(write(&at("packed.db3"), &standard(20), true, &[])).unwrap();
    let whole = zstd::encode_all(plain.as_slice(), 1).unwrap();
    let path = at("bag.db3");
    assert_answered("sqlite3", 600, &[plain, packed, whole], |bytes| {
        fs::write(&path, bytes).unwrap();
        read_all(&path, &at("out.mcap"))
    });
}

#[test]
fn a_mutated_folder_is_answered() {
    let folder = TempDir::new().unwrap();
    let bag = folder.path().join("bag");
    fs::create_dir(&bag).unwrap();
    telemetry_bag(&bag.join("bag_0.mcap"), 20);
    let metadata = bag.join("metadata.yaml");
    let text = "rosbag2_bagfile_information:\n  version: 9\n  storage_identifier: mcap\n  relative_file_paths:\n    - bag_0.mcap\n  message_count: 80\n";
    let (mut mutants, mut refused) = (Mutants::new(0xf01d), 0);
    let count = Mutants::count(1000);
    for text in (0..count).map(|_| mutants.text(text)).collect::<Vec<_>>().into_iter().chain(bombs()) {
        fs::write(&metadata, text).unwrap();
        refused += usize::from(Bag::open(&bag).is_err());
    }
    println!("metadata.yaml: {count} mutants, {refused} refused, held at most {:?} MB", peak_memory_mb());
    fs::File::create(&metadata).unwrap().set_len(1 << 40).unwrap();
    assert!(Bag::open(&bag).unwrap_err().to_string().contains("larger than"));
    assert!(peak_memory_mb().is_none_or(|mb| mb < MOST_MB), "{:?}", peak_memory_mb());
}

#[test]
fn a_mutated_topics_file_is_answered() {
    let folder = TempDir::new().unwrap();
    let bag = Bag::open(&telemetry_bag(&folder.path().join("a.mcap"), 20)).unwrap();
    let path = folder.path().join("topics.yaml");
    let stacks = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../params/stacks");
    let mut seeds: Vec<String> = fs::read_dir(stacks)
        .unwrap()
        .map(|entry| fs::read_to_string(entry.unwrap().path()).unwrap())
        .collect();
    seeds.sort();
    seeds.push(
        "odom: /odom\nsteering: {topic: /drive, field: drive.steering_angle, gain: 2.0, offset: -0.1}\n"
            .to_owned(),
    );
    let (mut mutants, mut refused) = (Mutants::new(0x7091c5), 0);
    let count = Mutants::count(4000);
    let texts: Vec<String> = (0..count).map(|k| mutants.text(&seeds[k % seeds.len()])).collect();
    for text in texts.into_iter().chain(bombs()) {
        fs::write(&path, text).unwrap();
        match TopicMap::read(&path) {
            Ok(topics) => drop(topics.resolve(&bag)),
            Err(error) => {
                refused += 1;
                assert!(error.to_string().contains("topics.yaml"), "{error}");
            }
        }
    }
    println!("topics file: {count} mutants, {refused} refused, held at most {:?} MB", peak_memory_mb());
    assert!(refused > count / 20, "{refused}");
    fs::File::create(&path).unwrap().set_len(1 << 40).unwrap();
    assert!(TopicMap::read(&path).unwrap_err().to_string().contains("larger than"));
    assert!(peak_memory_mb().is_none_or(|mb| mb < MOST_MB), "{:?}", peak_memory_mb());
}

/// A message of the type, every list in it one long, as CDR.
fn one_of_each<T: Message>() -> Vec<u8> {
    let ones = [1, 0, 0, 0].repeat(4000);
    let message: T = from_cdr(&[&[0, 1, 0, 0], ones.as_slice()].concat()).unwrap();
    to_cdr(&message).unwrap()
}

/// Mutants of a message; gives how many were made, and how many refused.
fn mutated<T: Message>() -> (usize, usize) {
    let whole = one_of_each::<T>();
    assert!(from_cdr::<T>(&whole).is_ok(), "{}", T::TYPE);
    let mut mutants = Mutants::new(0xcd2);
    let count = Mutants::count(300);
    let mut refused = 0;
    for _ in 0..count {
        let mut bytes = mutants.binary(&whole, 1, usize::MAX);
        if mutants.below(2) == 0 {
            mutants.length(bytes.get_mut(4..).unwrap_or_default());
        }
        refused += usize::from(from_cdr::<T>(&bytes).is_err());
    }
    (count, refused)
}

macro_rules! each {
    ($($kind:ty),* $(,)?) => { [$((<$kind>::TYPE, mutated::<$kind> as fn() -> (usize, usize))),*] };
}

#[test]
fn a_mutated_message_of_any_type_is_answered() {
    use gripsight_msgs as own;
    let types = each![
        own::IdentificationProgress,
        own::FrictionPrior,
        own::GapReport,
        own::ExtendedModel,
        own::PacejkaParams,
        own::TirePosterior,
        own::Grip,
        own::StateSequence,
        own::Excitation,
        own::ResidualModel,
        own::Residual,
        ackermann_msgs::AckermannDriveStamped,
        builtin_interfaces::Time,
        diagnostic_msgs::DiagnosticArray,
        geometry_msgs::PoseWithCovariance,
        geometry_msgs::TwistWithCovariance,
        nav_msgs::Odometry,
        rcl_interfaces::ListParametersResult,
        rcl_interfaces::Log,
        rcl_interfaces::ParameterDescriptor,
        rcl_interfaces::ParameterEvent,
        rcl_interfaces::SetParametersResult,
        rosgraph_msgs::Clock,
        sensor_msgs::CompressedImage,
        sensor_msgs::Image,
        sensor_msgs::Imu,
        sensor_msgs::JointState,
        std_msgs::Header,
    ];
    let (mut made, mut refused, start) = (0, 0, Instant::now());
    for (name, mutate) in types {
        let (count, not_taken) = mutate();
        println!("{name}: {count} mutants, {not_taken} refused");
        made += count;
        refused += not_taken;
    }
    let held_mb = peak_memory_mb();
    println!(
        "CDR: {made} mutants of {} types in {:.1?}, {refused} refused, held at most {held_mb:?} MB",
        types.len(),
        start.elapsed()
    );
    assert!(refused > made / 20);
    assert!(held_mb.is_none_or(|held_mb| held_mb < MOST_MB), "{held_mb:?} MB");
}

/// Types whose messages are read field by field, with a message of each.
fn described() -> Vec<(&'static str, String, Vec<u8>)> {
    let of = |name: &'static str, message| (name, schema(name).unwrap(), message);
    vec![
        of(nav_msgs::Odometry::TYPE, one_of_each::<nav_msgs::Odometry>()),
        of(sensor_msgs::JointState::TYPE, one_of_each::<sensor_msgs::JointState>()),
        of(diagnostic_msgs::DiagnosticArray::TYPE, one_of_each::<diagnostic_msgs::DiagnosticArray>()),
        of(rcl_interfaces::ParameterEvent::TYPE, one_of_each::<rcl_interfaces::ParameterEvent>()),
    ]
}

/// Reads every number that a type's text describes; whether all was taken.
fn read_described(name: &str, text: &str, message: &[u8]) -> Result<Vec<f64>, String> {
    let said = |error: BagError| error.to_string();
    let layout = Schema::parse(name, text).map_err(said)?;
    let paths = layout.numbers().iter().map(|path| path.parse()).collect::<Result<_, _>>()?;
    Reader::new(layout, paths).and_then(|reader| reader.read(message)).map_err(said)
}

#[test]
fn a_mutated_type_s_text_and_its_message_are_answered() {
    let (mut mutants, mut refused, start) = (Mutants::new(0x7e97), 0, Instant::now());
    let count = Mutants::count(4000);
    let described = described();
    for (name, text, message) in &described {
        assert!(read_described(name, text, message).is_ok(), "{name}");
    }
    for k in 0..count {
        let (name, text, message) = &described[k % described.len()];
        let answer = if mutants.below(2) == 0 {
            read_described(name, &mutants.text(text), message)
        } else {
            let mut bytes = mutants.binary(message, 1, usize::MAX);
            mutants.length(&mut bytes);
            read_described(name, text, &bytes)
        };
        refused += usize::from(answer.is_err());
    }
    for bomb in bombs() {
        assert!(read_described("a/msg/B", &bomb, &[0, 1, 0, 0]).is_err());
    }
    let held_mb = peak_memory_mb();
    println!(
        "types' texts and messages by them: {count} mutants in {:.1?}, {refused} refused, held at most {held_mb:?} MB",
        start.elapsed()
    );
    assert!(refused > count / 4);
    assert!(held_mb.is_none_or(|held_mb| held_mb < MOST_MB), "{held_mb:?} MB");
}

/// A type in itself, types without a field in endless lists, and types that hold the next one twice.
#[test]
fn a_type_made_to_harm_is_refused_or_read() {
    let line = "=".repeat(80);
    let message = [&[0, 1, 0, 0], [0xff; 64].as_slice()].concat();
    for text in ["A a".to_owned(), "A[] a".to_owned(), format!("B b\n{line}\nMSG: p/B\nA a")] {
        let error = Schema::parse("p/msg/A", &text).unwrap_err().to_string();
        assert!(error.contains("holds itself"), "{error}");
    }
    let empty = format!("Nothing[] list\nfloat64 x\n{line}\nMSG: p/Nothing\n# no field");
    assert!(read_described("p/msg/A", &empty, &message).is_err());
    let blocks = format!("B[1000000000] b\n{line}\nMSG: p/B\nC[1000000000] c\n{line}\nMSG: p/C\n");
    assert!(read_described("p/msg/A", &blocks, &message).is_err());
    let twice: String =
        (0..30).map(|k| format!("{line}\nMSG: p/T{k}\nT{n} a\nT{n} b\n", n = k + 1)).collect();
    let twice = format!("T0 a\n{twice}{line}\nMSG: p/T30\nstring s\n");
    let error = Schema::parse("p/msg/A", &twice).unwrap_err().to_string();
    assert!(error.contains("more than 10000 fields"), "{error}");
}

/// What SQLite would compute, not read: rows without end, and a gigabyte a row.
#[test]
fn a_database_made_to_harm_is_refused() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("made.db3");
    let topics = "CREATE TABLE topics(id INTEGER PRIMARY KEY, name TEXT, type TEXT, serialization_format TEXT, offered_qos_profiles TEXT); \
                  INSERT INTO topics VALUES (1, '/odom', 'nav_msgs/msg/Odometry', 'cdr', '');";
    for messages in [
        "CREATE VIEW messages(id, topic_id, timestamp, data) AS \
         WITH RECURSIVE n(i) AS (SELECT 1 UNION ALL SELECT i + 1 FROM n) SELECT i, 1, i, x'00' FROM n;",
        "CREATE TABLE messages(id INTEGER PRIMARY KEY, topic_id INTEGER, timestamp INTEGER, \
         data BLOB GENERATED ALWAYS AS (zeroblob(999999999)) VIRTUAL); \
         INSERT INTO messages(id, topic_id, timestamp) VALUES (1, 1, 1), (2, 1, 2), (3, 1, 3);",
    ] {
        let _ = fs::remove_file(&path);
        Connection::open(&path).unwrap().execute_batch(&format!("{topics}{messages}")).unwrap();
        let error = Bag::open(&path).unwrap_err().to_string();
        assert!(error.contains("`messages` is no plain table") && error.contains("made.db3"), "{error}");
    }
    assert!(peak_memory_mb().is_none_or(|mb| mb < MOST_MB), "{:?}", peak_memory_mb());
}

/// Found by the mutants: a tree whose rows come again and again.
#[test]
fn a_database_whose_rows_come_again_has_an_end() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("bag.db3");
    fs::write(&path, include_bytes!("disordered.db3.zstd")).unwrap();
    assert!(Bag::open(&path).unwrap().messages().any(|message| message.is_err()));
}

/// Few bytes that unpack to many: a message, a record in a chunk, a file.
#[test]
fn what_unpacks_without_measure_is_refused() {
    let folder = TempDir::new().unwrap();
    let zeros = |len: u64| zstd::encode_all(std::io::Read::take(std::io::repeat(0), len), 1).unwrap();
    let long = zeros(600 << 20);
    let [(name, kind, _), _] = standard(1);
    let path = write(&folder.path().join("long.db3"), &[(name, kind, vec![(1, long.clone())])], false, &[]);
    let refusal = |path: &Path| {
        let answers = Bag::open(path).and_then(|bag| bag.messages().collect::<Result<Vec<_>, _>>());
        answers.unwrap_err().to_string()
    };
    let error = refusal(&path);
    assert!(error.contains("longer than 256 MiB") && error.contains("long.db3"), "{error}");
    let channel = Channel { data: long, ..Channel::odom() };
    let path = file(&folder, &mcap_bytes("ros2", mcap::WriteOptions::new().use_chunks(false), &[channel]));
    let error = refusal(&path);
    assert!(error.contains("longer than 256 MiB"), "{error}");
    let path = folder.path().join("file.db3.zstd");
    fs::write(&path, zeros(600 << 20)).unwrap();
    let error = refusal(&path);
    assert!(error.contains("1000 times as long") && error.contains("file.db3.zstd"), "{error}");
    assert!(peak_memory_mb().is_none_or(|mb| mb < MOST_MB), "{:?}", peak_memory_mb());
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 300, ..ProptestConfig::default() })]

    #[test]
    fn cut_and_spliced_bytes(seed in 0usize..6, cut in any::<prop::sample::Index>(), from in any::<prop::sample::Index>()) {
        let bytes = &seeds()[seed];
        let (cut, from) = (cut.index(bytes.len()), from.index(bytes.len()));
        let folder = TempDir::new().unwrap();
        let out = folder.path().join("out.mcap");
        read_all(&file(&folder, &bytes[..cut]), &out);
        read_all(&file(&folder, &[&bytes[..cut], &bytes[from..]].concat()), &out);
    }

    #[test]
    fn any_bytes_as_messages(bytes in prop::collection::vec(any::<u8>(), 0..400), little in any::<bool>()) {
        let bytes = [&[0, u8::from(little), 0, 0], &bytes[..]].concat();
        let _ = from_cdr::<nav_msgs::Odometry>(&bytes);
        let _ = from_cdr::<sensor_msgs::JointState>(&bytes).map(|m| decode::wheels(&m));
        let mut reassembler = Reassembler::default();
        let _ = from_cdr::<gripsight_msgs::StateSequence>(&bytes).map(|m| reassembler.push(m));
    }
}
