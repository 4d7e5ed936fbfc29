//! The C functions of FMI 3.0, for co-simulation.
//!
//! What the unit does not offer (model exchange, scheduled execution, clocks, types of variables that it has none of) is there and answers with
//! an error, or with no instance: an importer may look every function up.

#![allow(
    unsafe_code,
    reason = "a C interface: pointers come from the importer, which guarantees them by the standard"
)]

use std::ffi::{CStr, c_char, c_int, c_void};
use std::path::Path;

use crate::interface::{
    ERROR, NO_CAR, OK, array, array_mut, free, free_state, get_state, instantiate, on, set_state,
};

type Log = Option<unsafe extern "C" fn(*mut c_void, c_int, *const c_char, *const c_char)>;

#[unsafe(no_mangle)]
extern "C" fn fmi3GetVersion() -> *const c_char {
    c"3.0".as_ptr()
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3InstantiateCoSimulation(
    _name: *const c_char,
    _token: *const c_char,
    resources: *const c_char,
    _visible: bool,
    _logging: bool,
    _event_mode: bool,
    _early_return: bool,
    _intermediate: *const u32,
    _intermediate_count: usize,
    environment: *mut c_void,
    log: Log,
    _update: *const c_void,
) -> *mut c_void {
    if resources.is_null() {
        return std::ptr::null_mut();
    }
    // SAFETY: a text of the importer, ended by 0.
    let folder = unsafe { CStr::from_ptr(resources) }.to_string_lossy();
    let say = Box::new(move |what: &CStr| {
        if let Some(log) = log {
            // SAFETY: the importer's own function and environment; both texts outlive the call.
            unsafe { log(environment, ERROR, c"logStatusError".as_ptr(), what.as_ptr()) };
        }
    });
    instantiate(Path::new(folder.as_ref()), say)
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeInstance(instance: *mut c_void) {
    // SAFETY: an instance of the importer, here and below.
    unsafe { free(instance) };
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetDebugLogging(
    _instance: *mut c_void,
    _on: bool,
    _count: usize,
    _categories: *const *const c_char,
) -> c_int {
    OK
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3EnterInitializationMode(
    instance: *mut c_void,
    _tolerance_defined: bool,
    _tolerance: f64,
    start_s: f64,
    _stop_defined: bool,
    _stop_s: f64,
) -> c_int {
    unsafe { on(instance, c"the start time", |unit| unit.begin_at(start_s)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3ExitInitializationMode(instance: *mut c_void) -> c_int {
    unsafe { on(instance, NO_CAR, |unit| unit.start()) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3Terminate(instance: *mut c_void) -> c_int {
    unsafe { on(instance, c"terminate", |_| true) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3Reset(instance: *mut c_void) -> c_int {
    unsafe {
        on(instance, c"reset", |unit| {
            unit.reset();
            true
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3DoStep(
    instance: *mut c_void,
    _time_s: f64,
    step_s: f64,
    _no_going_back: bool,
    event: *mut bool,
    terminate: *mut bool,
    early: *mut bool,
    last_s: *mut f64,
) -> c_int {
    for flag in [event, terminate, early] {
        // SAFETY: null, or the importer's own variable, here and below.
        if let Some(flag) = unsafe { flag.as_mut() } {
            *flag = false;
        }
    }
    unsafe {
        on(instance, c"the step has no length, or the car is nowhere", |unit| {
            let done = unit.step(step_s);
            if let Some(last_s) = last_s.as_mut() {
                *last_s = unit.time_s();
            }
            done
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetFloat64(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut f64,
    value_count: usize,
) -> c_int {
    // SAFETY: arrays of the importer with their lengths, here and below.
    let (references, values) = unsafe { (array(references, count), array_mut(values, value_count)) };
    unsafe {
        on(instance, c"a number that is not there", |unit| unit.get_all(references, values, false, |v| v))
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetFloat64(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    values: *const f64,
    value_count: usize,
) -> c_int {
    let (references, values) = unsafe { (array(references, count), array(values, value_count)) };
    unsafe {
        on(instance, c"a number that cannot be set now, or is not finite", |unit| {
            unit.set_all(references, values, false, |v| v)
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetBoolean(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    values: *mut bool,
    value_count: usize,
) -> c_int {
    let (references, values) = unsafe { (array(references, count), array_mut(values, value_count)) };
    unsafe {
        on(instance, c"a switch that is not there", |unit| {
            unit.get_all(references, values, true, |v| v != 0.0)
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetBoolean(
    instance: *mut c_void,
    references: *const u32,
    count: usize,
    values: *const bool,
    value_count: usize,
) -> c_int {
    let (references, values) = unsafe { (array(references, count), array(values, value_count)) };
    unsafe {
        on(instance, c"a switch that cannot be set now", |unit| {
            unit.set_all(references, values, true, f64::from)
        })
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3GetFMUState(instance: *mut c_void, state: *mut *mut c_void) -> c_int {
    // SAFETY: the importer's variable, with null or a state of ours in it, here and below.
    unsafe { get_state(instance, state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3SetFMUState(instance: *mut c_void, state: *mut c_void) -> c_int {
    unsafe { set_state(instance, state) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi3FreeFMUState(_instance: *mut c_void, state: *mut *mut c_void) -> c_int {
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
    fmi3EnterEventMode fmi3EnterStepMode fmi3EnterConfigurationMode fmi3ExitConfigurationMode
    fmi3GetFloat32 fmi3GetInt8 fmi3GetUInt8 fmi3GetInt16 fmi3GetUInt16 fmi3GetInt32 fmi3GetUInt32 fmi3GetInt64
    fmi3GetUInt64 fmi3GetString fmi3GetBinary fmi3GetClock fmi3SetFloat32 fmi3SetInt8 fmi3SetUInt8 fmi3SetInt16
    fmi3SetUInt16 fmi3SetInt32 fmi3SetUInt32 fmi3SetInt64 fmi3SetUInt64 fmi3SetString fmi3SetBinary fmi3SetClock
    fmi3GetNumberOfVariableDependencies fmi3GetVariableDependencies fmi3SerializedFMUStateSize
    fmi3SerializeFMUState fmi3DeserializeFMUState fmi3GetDirectionalDerivative fmi3GetAdjointDerivative
    fmi3GetIntervalDecimal fmi3GetIntervalFraction fmi3GetShiftDecimal fmi3GetShiftFraction fmi3SetIntervalDecimal
    fmi3SetIntervalFraction fmi3SetShiftDecimal fmi3SetShiftFraction fmi3EvaluateDiscreteStates
    fmi3UpdateDiscreteStates fmi3EnterContinuousTimeMode fmi3CompletedIntegratorStep fmi3SetTime
    fmi3SetContinuousStates fmi3GetContinuousStateDerivatives fmi3GetEventIndicators fmi3GetContinuousStates
    fmi3GetNominalsOfContinuousStates fmi3GetNumberOfEventIndicators fmi3GetNumberOfContinuousStates
    fmi3GetOutputDerivatives fmi3ActivateModelPartition
}

/// Kinds of instances that are not offered.
macro_rules! no_instance {
    ($($name:ident)+) => {
        $(#[unsafe(no_mangle)]
        extern "C" fn $name() -> *mut c_void {
            std::ptr::null_mut()
        })+
    };
}

no_instance! { fmi3InstantiateModelExchange fmi3InstantiateScheduledExecution }
