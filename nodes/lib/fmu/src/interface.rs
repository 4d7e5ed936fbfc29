//! What both versions of the interface share: instances, arrays of the importer, states.

#![allow(
    unsafe_code,
    reason = "a C interface: pointers come from the importer, which guarantees them by the standard"
)]

use std::ffi::{CStr, CString, c_int, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;

use crate::Unit;

pub(crate) const OK: c_int = 0;
pub(crate) const ERROR: c_int = 3;
const FATAL: c_int = 4;

/// Why a drive does not start.
pub(crate) const NO_CAR: &CStr =
    c"the parameters are not those of a car: masses, lengths and steps are positive, shares between 0 and 1";

/// Tells the importer what went wrong.
pub(crate) type Say = Box<dyn Fn(&CStr)>;

/// What an importer holds.
pub(crate) struct Instance {
    pub(crate) unit: Unit,
    say: Say,
}

/// An instance of the unit with these resources; null, and said why, where there is none.
pub(crate) fn instantiate(resources: &Path, say: Say) -> *mut c_void {
    match catch_unwind(AssertUnwindSafe(|| Unit::of_resources(resources))) {
        Ok(Ok(unit)) => Box::into_raw(Box::new(Instance { unit, say })).cast(),
        Ok(Err(error)) => {
            say(&CString::new(error.to_string()).unwrap_or_default());
            std::ptr::null_mut()
        }
        Err(_) => std::ptr::null_mut(),
    }
}

/// The end of an instance.
///
/// # Safety
/// As for [`on`], and it is not used again.
pub(crate) unsafe fn free(instance: *mut c_void) {
    if !instance.is_null() {
        // SAFETY: by the caller's promise.
        drop(unsafe { Box::from_raw(instance.cast::<Instance>()) });
    }
}

/// Runs a call on an instance; a null pointer and what fails are errors, what panics is fatal.
///
/// # Safety
/// `instance` is null or comes from [`instantiate`] and was not freed.
pub(crate) unsafe fn on(instance: *mut c_void, what: &CStr, call: impl FnOnce(&mut Unit) -> bool) -> c_int {
    // SAFETY: by the caller's promise.
    let Some(instance) = (unsafe { instance.cast::<Instance>().as_mut() }) else { return ERROR };
    match catch_unwind(AssertUnwindSafe(|| call(&mut instance.unit))) {
        Ok(true) => OK,
        Ok(false) => {
            (instance.say)(what);
            ERROR
        }
        Err(_) => FATAL,
    }
}

/// An importer's array; empty where it has no length.
///
/// # Safety
/// `first` points to `count` values, or `count` is 0.
pub(crate) unsafe fn array<'a, T>(first: *const T, count: usize) -> &'a [T] {
    if count == 0 || first.is_null() {
        return &[];
    }
    // SAFETY: by the caller's promise.
    unsafe { std::slice::from_raw_parts(first, count) }
}

/// The same, to be written.
///
/// # Safety
/// As for [`array`], and nobody else looks at it.
pub(crate) unsafe fn array_mut<'a, T>(first: *mut T, count: usize) -> &'a mut [T] {
    if count == 0 || first.is_null() {
        return &mut [];
    }
    // SAFETY: by the caller's promise.
    unsafe { std::slice::from_raw_parts_mut(first, count) }
}

/// Keeps an instance's state.
///
/// # Safety
/// As for [`on`]; `state` is null or points to null or to a state of this function.
pub(crate) unsafe fn get_state(instance: *mut c_void, state: *mut *mut c_void) -> c_int {
    // SAFETY: by the caller's promise.
    unsafe {
        on(instance, c"there is nowhere to put the state", |unit| {
            let Some(state) = state.as_mut() else { return false };
            match state.cast::<Unit>().as_mut() {
                Some(old) => *old = unit.clone(),
                None => *state = Box::into_raw(Box::new(unit.clone())).cast(),
            }
            true
        })
    }
}

/// Goes back to a state.
///
/// # Safety
/// As for [`on`]; `state` is null or a state of [`get_state`].
pub(crate) unsafe fn set_state(instance: *mut c_void, state: *mut c_void) -> c_int {
    // SAFETY: by the caller's promise.
    unsafe {
        on(instance, c"there is no state", |unit| {
            state.cast::<Unit>().as_ref().map(|state| *unit = state.clone()).is_some()
        })
    }
}

/// The end of a state.
///
/// # Safety
/// As for [`get_state`].
pub(crate) unsafe fn free_state(state: *mut *mut c_void) -> c_int {
    // SAFETY: by the caller's promise.
    unsafe {
        if let Some(state) = state.as_mut().filter(|s| !s.is_null()) {
            drop(Box::from_raw(state.cast::<Unit>()));
            *state = std::ptr::null_mut();
        }
    }
    OK
}
