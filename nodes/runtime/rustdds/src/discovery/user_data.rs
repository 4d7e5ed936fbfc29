//! The user data of local endpoints (USER_DATA of DDS 1.4, 2.2.3.1), which discovery announces.

use std::sync::OnceLock;

static OF_TYPE: OnceLock<fn(type_name: &str) -> Vec<u8>> = OnceLock::new();

/// Sets which user data the endpoints of this process announce, by the name of their type; to be
/// called before the first is created. Later calls have no effect.
pub fn set_endpoint_user_data(of_type: fn(type_name: &str) -> Vec<u8>) {
  OF_TYPE.get_or_init(|| of_type);
}

/// As it is sent: a sequence of octets, its length first.
pub(crate) fn endpoint_user_data(type_name: &str) -> Vec<u8> {
  let data = OF_TYPE.get().map_or_else(Vec::new, |of_type| of_type(type_name));
  if data.is_empty() {
    return data;
  }
  let mut sent = (data.len() as u32).to_le_bytes().to_vec();
  sent.extend(data);
  sent
}
