//! The C functions of FMI 2.0, for co-simulation. As in [`crate::fmi3`], what is not offered answers with an error.

#![allow(
    unsafe_code,
    reason = "a C interface: pointers come from the importer, which guarantees them by the standard"
)]

use std::ffi::{CStr, CString, OsStr, c_char, c_int, c_void};
use std::os::unix::ffi::OsStrExt as _;
use std::path::Path;

use crate::interface::{
    ERROR, NO_CAR, OK, array, array_mut, free, free_state, get_state, instantiate, on, set_state,
};

/// Kind of instance that is offered.
const CO_SIMULATION: c_int = 1;

type Log = Option<unsafe extern "C" fn(*mut c_void, *const c_char, c_int, *const c_char, *const c_char, ...)>;

/// What the importer offers; memory and the end of steps that go on by themselves are not needed.
#[repr(C)]
struct Callbacks {
    log: Log,
    allocate: *const c_void,
    free: *const c_void,
    step_finished: *const c_void,
    environment: *mut c_void,
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> *const c_char {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> *const c_char {
    c"2.0".as_ptr()
}

/// The path of a `file:` address, its escapes undone.
fn path_of(address: &[u8]) -> Vec<u8> {
    let rest =
        [b"file://localhost".as_slice(), b"file://", b"file:"].iter().find_map(|p| address.strip_prefix(*p));
    let mut rest = rest.unwrap_or(address);
    let mut path = Vec::with_capacity(rest.len());
    while let [byte, after @ ..] = rest {
        let hex = |b: u8| char::from(b).to_digit(16);
        rest = after;
        match (byte, after) {
            (b'%', [high, low, further @ ..]) if hex(*high).is_some() && hex(*low).is_some() => {
                let value = hex(*high).unwrap_or(0) * 16 + hex(*low).unwrap_or(0);
                path.push(u8::try_from(value).unwrap_or(b'%'));
                rest = further;
            }
            _ => path.push(*byte),
        }
    }
    path
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    name: *const c_char,
    kind: c_int,
    _guid: *const c_char,
    resources: *const c_char,
    callbacks: *const Callbacks,
    _visible: c_int,
    _logging: c_int,
) -> *mut c_void {
    if kind != CO_SIMULATION || resources.is_null() {
        return std::ptr::null_mut();
    }
    // SAFETY: texts of the importer, ended by 0, and its functions or null.
    let (folder, name, callbacks) = unsafe {
        let name = if name.is_null() { CString::default() } else { CStr::from_ptr(name).to_owned() };
        (path_of(CStr::from_ptr(resources).to_bytes()), name, callbacks.as_ref())
    };
    let log = callbacks.and_then(|c| Some((c.log?, c.environment)));
    let say = Box::new(move |what: &CStr| {
        if let Some((log, environment)) = log {
            // SAFETY: the importer's own function and environment; the texts outlive the call, and `%s` is what it formats.
            unsafe {
                log(
                    environment,
                    name.as_ptr(),
                    ERROR,
                    c"logStatusError".as_ptr(),
                    c"%s".as_ptr(),
                    what.as_ptr(),
                );
            };
        }
    });
    instantiate(Path::new(OsStr::from_bytes(&folder)), say)
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeInstance(instance: *mut c_void) {
    // SAFETY: an instance of the importer, here and below.
    unsafe { free(instance) };
}

#[unsafe(no_mangle)]
extern "C" fn fmi2SetDebugLogging() -> c_int {
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetupExperiment(
    instance: *mut c_void,
    _tolerance_defined: c_int,
    _tolerance: f64,
    start_s: f64,
    _stop_defined: c_int,
    _stop_s: f64,
) -> c_int {
    unsafe { on(instance, c"the start time", |unit| unit.begin_at(start_s)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2EnterInitializationMode(instance: *mut c_void) -> c_int {
    unsafe { on(instance, c"initialize", |_| true) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2ExitInitializationMode(instance: *mut c_void) -> c_int {
    unsafe { on(instance, NO_CAR, |unit| unit.start()) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Terminate(instance: *mut c_void) -> c_int {
    unsafe { on(instance, c"terminate", |_| true) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Reset(instance: *mut c_void) -> c_int {
    unsafe {
        on(instance, c"reset", |unit| {
            unit.reset();
            true
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DoStep(
    instance: *mut c_void,
    _time_s: f64,
    step_s: f64,
    _no_going_back: c_int,
) -> c_int {
    unsafe { on(instance, c"the step has no length, or the car is nowhere", |unit| unit.step(step_s)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetReal(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut f64,
) -> c_int {
    // SAFETY: arrays of the importer with their length, here and below.
    let (references, values) = unsafe { (array(references, count), array_mut(values, count)) };
    unsafe {
        on(instance, c"a number that is not there", |unit| unit.get_all(references, values, false, |v| v))
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetReal(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    values: *const f64,
) -> c_int {
    let (references, values) = unsafe { (array(references, count), array(values, count)) };
    unsafe {
        on(instance, c"a number that cannot be set now, or is not finite", |unit| {
            unit.set_all(references, values, false, |v| v)
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetBoolean(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut c_int,
) -> c_int {
    let (references, values) = unsafe { (array(references, count), array_mut(values, count)) };
    unsafe {
        on(instance, c"a switch that is not there", |unit| {
            unit.get_all(references, values, true, |v| c_int::from(v != 0.0))
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetBoolean(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    values: *const c_int,
) -> c_int {
    let (references, values) = unsafe { (array(references, count), array(values, count)) };
    unsafe {
        on(instance, c"a switch that cannot be set now", |unit| {
            unit.set_all(references, values, true, |v| f64::from(v != 0))
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetFMUstate(instance: *mut c_void, state: *mut *mut c_void) -> c_int {
    // SAFETY: the importer's variable, with null or a state of ours in it, here and below.
    unsafe { get_state(instance, state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetFMUstate(instance: *mut c_void, state: *mut c_void) -> c_int {
    unsafe { set_state(instance, state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeFMUstate(_instance: *mut c_void, state: *mut *mut c_void) -> c_int {
    unsafe { free_state(state) }
}

/// Functions that are not offered. The caller lays down and takes back the arguments, which none of them looks at.
macro_rules! not_offered {
    ($($name:ident)+) => {
        $(#[unsafe(no_mangle)]
        extern "C" fn $name() -> c_int {
            ERROR
        })+
    };
}

not_offered! {
    fmi2GetInteger fmi2GetString fmi2SetInteger fmi2SetString fmi2SerializedFMUstateSize fmi2SerializeFMUstate
    fmi2DeSerializeFMUstate fmi2GetDirectionalDerivative fmi2SetRealInputDerivatives fmi2GetRealOutputDerivatives
    fmi2CancelStep fmi2GetStatus fmi2GetRealStatus fmi2GetIntegerStatus fmi2GetBooleanStatus fmi2GetStringStatus
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_folder_of_an_address_is_found() {
        let of = |address: &str| String::from_utf8(path_of(address.as_bytes())).unwrap();
        assert_eq!(of("file:///tmp/a%20car/resources"), "/tmp/a car/resources");
        assert_eq!(of("file://localhost/tmp/100%"), "/tmp/100%");
        assert_eq!(of("file:/tmp/%c3%a4"), "/tmp/ä");
        assert_eq!(of("/tmp/plain"), "/tmp/plain");
    }
}
