use std::io::Write as _;

use zip::ZipWriter;
use zip::write::SimpleFileOptions;

use super::*;

/// An array as NumPy writes it, whose header declares a shape.
fn npy(descriptor: &str, shape: &str, data: &[u8]) -> Vec<u8> {
    let dictionary = format!("{{'descr': '{descriptor}', 'fortran_order': False, 'shape': {shape}, }}");
    let length = (10 + dictionary.len() + 1).next_multiple_of(64) - 10;
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend(u16::try_from(length).unwrap().to_le_bytes());
    bytes.extend(format!("{dictionary:<width$}\n", width = length - 1).bytes());
    bytes.extend(data);
    bytes
}

fn said(entries: &[(&str, Vec<u8>)]) -> Result<Answer, String> {
    let mut body = Cursor::new(Vec::new());
    let mut archive = ZipWriter::new(&mut body);
    for (name, bytes) in entries {
        archive.start_file(*name, SimpleFileOptions::default()).unwrap();
        archive.write_all(bytes).unwrap();
    }
    archive.finish().unwrap();
    let body = body.into_inner();
    let mut message = (body.len() as u64).to_le_bytes().to_vec();
    message.extend(body);
    read(&mut message.as_slice()).unwrap()
}

fn header() -> (&'static str, Vec<u8>) {
    let text = br#"{"version": 1, "id": 7, "kind": "outputs"}"#;
    ("header.npy", npy("|u1", &format!("({},)", text.len()), text))
}

#[test]
fn an_answer_as_numpy_writes_it_is_read() {
    let data: Vec<u8> = [1.0f64, 2.0, 3.0, 4.0].iter().flat_map(|v| v.to_le_bytes()).collect();
    let answer = said(&[header(), ("outputs.npy", npy("<f8", "(1, 2, 2)", &data))]).unwrap();
    assert_eq!(answer.header.id, Some(7));
    assert_eq!(answer.outputs.unwrap()[(0, 1, 0)], 3.0);
    assert!(said(&[header()]).unwrap().outputs.is_none());
}

/// Of a shape that is not there no memory is asked for: the program would end.
#[test]
fn an_array_that_declares_more_than_it_holds_is_an_error() {
    for shape in ["(1000000, 1000000, 1000)", "(18446744073709551615, 2, 2)", "(1, 2, 3)"] {
        let why = said(&[header(), ("outputs.npy", npy("<f8", shape, &[0; 32]))]).unwrap_err();
        assert!(why.starts_with("its outputs"), "{why}");
    }
    let why = said(&[("header.npy", npy("|u1", "(1000000000000,)", b"{}"))]).unwrap_err();
    assert!(why.starts_with("its header"), "{why}");
    let why = said(&[]).unwrap_err();
    assert!(why.contains("there is none"), "{why}");
}
