//! Messages as CDR bytes with their encapsulation header, as on the wire and in a bag.
//!
//! Read: plain CDR, version 1, little- or big-endian. Written: little-endian, padded with zero bytes to a multiple of four.
//! Source: OMG DDSI-RTPS 2.3, section 10.

use byteorder::{BigEndian, LittleEndian};
use gripsight_msgs::Message;

use crate::BagError;

const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// Reads a message from its CDR bytes; bytes after it (padding) are left alone.
///
/// # Errors
/// [`BagError::NoEncapsulation`], [`BagError::Encapsulation`], [`BagError::Body`]; lengths inside the bytes are never trusted.
pub fn from_cdr<T: Message>(bytes: &[u8]) -> Result<T, BagError> {
    let Some((&[id_high, id_low, ..], body)) = bytes.split_first_chunk::<4>() else {
        return Err(BagError::NoEncapsulation { len: bytes.len() });
    };
    let decoded = match u16::from_be_bytes([id_high, id_low]) {
        0 => cdr_encoding::from_bytes::<T, BigEndian>(body),
        1 => cdr_encoding::from_bytes::<T, LittleEndian>(body),
        identifier => return Err(BagError::Encapsulation { identifier }),
    };
    decoded.map(|(message, _)| message).map_err(|e| body_error::<T>(bytes.len(), &e))
}

/// Writes a message as CDR bytes.
///
/// # Errors
/// [`BagError::Body`] where the message does not encode (a sequence of over 2^32 values).
pub fn to_cdr<T: Message>(message: &T) -> Result<Vec<u8>, BagError> {
    let mut bytes = LITTLE_ENDIAN.to_vec();
    cdr_encoding::to_writer::<T, LittleEndian, _>(&mut bytes, message).map_err(|e| body_error::<T>(0, &e))?;
    bytes.resize(bytes.len().next_multiple_of(4), 0);
    Ok(bytes)
}

fn body_error<T: Message>(len: usize, error: &cdr_encoding::Error) -> BagError {
    BagError::Body { type_name: T::TYPE, len, why: error.to_string() }
}
