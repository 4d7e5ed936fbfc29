//! A simulator in Rust: answers gripsight as `adapters/gripsight_simulator.py` does for one in Python.

use std::io::{Cursor, Read as _, Write as _};
use std::os::unix::net::UnixStream;
use std::path::Path;

use ndarray::{Array1, Array2, Array3};
use ndarray_npy::{NpzReader, NpzWriter, ReadNpzError, WriteNpzError};
use serde::Deserialize;

use crate::wire::{Batch, VERSION};
use crate::{Channel, Description, SimulatorError};

/// A simulator with two methods; values come and go in the order of its description.
pub trait Stepped {
    /// What it is.
    fn description(&self) -> &Description;

    /// Puts the car into a motion and gives the outputs there. `fresh`: everything hidden is forgotten, too.
    ///
    /// # Errors
    /// Why these parameters cannot be.
    fn place(&mut self, parameters: &[f64], motion: &[f64], fresh: bool) -> Result<Vec<f64>, String>;

    /// Holds a command over a step and gives the outputs after it.
    fn step(&mut self, command: &[f64]) -> Vec<f64>;
}

#[derive(Deserialize)]
struct Request {
    version: u32,
    id: u64,
    kind: String,
}

/// Answers gripsight, which started this process, until it hangs up.
///
/// # Errors
/// [`SimulatorError::Io`] where gripsight did not start it, or the connection breaks.
pub fn serve(simulator: &mut dyn Stepped) -> Result<(), SimulatorError> {
    let socket = std::env::var_os("GRIPSIGHT_SOCKET").unwrap_or_default();
    let socket = Path::new(&socket);
    let mut stream = UnixStream::connect(socket).map_err(SimulatorError::io(socket))?;
    loop {
        let mut length = [0; 8];
        match stream.read_exact(&mut length) {
            Err(e) if e.kind() == std::io::ErrorKind::UnexpectedEof => return Ok(()),
            other => other.map_err(SimulatorError::io(socket))?,
        }
        let mut body = vec![0; u64::from_le_bytes(length) as usize];
        stream.read_exact(&mut body).map_err(SimulatorError::io(socket))?;
        let (header, outputs) = answer(simulator, body);
        let body = packed(&header, outputs.as_ref()).map_err(std::io::Error::other);
        let body = body.map_err(SimulatorError::io(socket))?;
        let sent =
            stream.write_all(&(body.len() as u64).to_le_bytes()).and_then(|()| stream.write_all(&body));
        sent.map_err(SimulatorError::io(socket))?;
    }
}

fn answer(simulator: &mut dyn Stepped, body: Vec<u8>) -> (serde_json::Value, Option<Array3<f64>>) {
    let mut id = None;
    let result = requested(body).and_then(|(request, batch)| {
        id = Some(request.id);
        if request.version != VERSION {
            return Err(format!("speaks version {VERSION}, was asked in version {}", request.version));
        }
        match (request.kind.as_str(), batch) {
            ("describe", _) => Ok(None),
            (_, Some(batch)) => rollout(simulator, &batch).map(Some),
            (kind, None) => Err(format!("was asked {kind} without a batch")),
        }
    });
    let head = |kind: &str| serde_json::json!({"version": VERSION, "id": id, "kind": kind});
    match result {
        Ok(None) => {
            let mut header = head("description");
            header["description"] = serde_json::json!(simulator.description());
            (header, None)
        }
        Ok(Some(outputs)) => (head("outputs"), Some(outputs)),
        Err(message) => {
            let mut header = head("error");
            header["message"] = message.into();
            (header, None)
        }
    }
}

fn requested(body: Vec<u8>) -> Result<(Request, Option<Batch>), String> {
    let read = |body: Vec<u8>| -> Result<(Array1<u8>, Option<Batch>), ReadNpzError> {
        let mut archive = NpzReader::new(Cursor::new(body))?;
        let names = archive.names()?;
        let has = |name: &str| names.iter().any(|n| n.trim_end_matches(".npy") == name);
        let header = archive.by_name("header")?;
        if !has("commands") {
            return Ok((header, None));
        }
        let batch = Batch {
            parameters: archive.by_name("parameters")?,
            commands: archive.by_name("commands")?,
            place_steps: archive.by_name("place_steps")?,
            motions: archive.by_name("motions")?,
            v_x_mps: has("v_x").then(|| archive.by_name::<_, _>("v_x")).transpose()?,
            kicks: has("kicks").then(|| archive.by_name::<_, _>("kicks")).transpose()?,
            output_steps: archive.by_name("output_steps")?,
        };
        Ok((header, Some(batch)))
    };
    let (header, batch) = read(body).map_err(|e| e.to_string())?;
    Ok((serde_json::from_slice(&header.to_vec()).map_err(|e| e.to_string())?, batch))
}

fn packed(header: &serde_json::Value, outputs: Option<&Array3<f64>>) -> Result<Vec<u8>, WriteNpzError> {
    let mut body = Cursor::new(Vec::new());
    let mut archive = NpzWriter::new(&mut body);
    archive.add_array("header", &Array1::from_vec(header.to_string().into_bytes()))?;
    if let Some(outputs) = outputs {
        archive.add_array("outputs", outputs)?;
    }
    archive.finish()?;
    Ok(body.into_inner())
}

/// Every pass of a batch.
fn rollout(simulator: &mut dyn Stepped, batch: &Batch) -> Result<Array3<f64>, String> {
    let description = simulator.description().clone();
    let places: Vec<usize> = description
        .states
        .iter()
        .map(|s| description.output(*s).ok_or("every state must be among the outputs"))
        .collect::<Result<_, _>>()?;
    let along = description.state(Channel::VXMps);
    let steps = batch.commands.shape()[1];
    let mut outputs = Array3::zeros((batch.passes(), batch.output_steps.len(), description.outputs.len()));
    let row3 = |a: &Array3<f64>, b: usize, k: usize| -> Vec<f64> {
        a.slice(ndarray::s![if a.shape()[0] > 1 { b } else { 0 }, k, ..]).to_vec()
    };
    let at2 = |a: &Array2<f64>, b: usize, k: usize| a[[if a.nrows() > 1 { b } else { 0 }, k]];
    for b in 0..batch.passes() {
        let parameters = batch.parameters.row(b).to_vec();
        let mut seen: Option<Vec<f64>> = None;
        let (mut next_place, mut next_output) = (0, 0);
        for k in 0..=steps {
            if batch.place_steps.get(next_place).is_some_and(|p| *p as usize == k) {
                let motion = row3(&batch.motions, b, next_place);
                seen = Some(simulator.place(&parameters, &motion, next_place == 0)?);
                next_place += 1;
            } else if let (Some(now), true) = (&seen, batch.v_x_mps.is_some() || batch.kicks.is_some()) {
                let mut motion: Vec<f64> = places.iter().map(|p| now[*p]).collect();
                if let Some(kicks) = &batch.kicks {
                    motion.iter_mut().zip(row3(kicks, b, k - 1)).for_each(|(m, d)| *m += d);
                }
                if let (Some(v_x), Some(along)) = (&batch.v_x_mps, along) {
                    motion[along] = at2(v_x, b, k);
                }
                seen = Some(simulator.place(&parameters, &motion, false)?);
            }
            while batch.output_steps.get(next_output).is_some_and(|o| *o as usize == k) {
                let now = seen.as_ref().ok_or("outputs are wanted before the car is placed")?;
                outputs.slice_mut(ndarray::s![b, next_output, ..]).assign(&Array1::from_vec(now.clone()));
                next_output += 1;
            }
            if k < steps && seen.is_some() {
                seen = Some(simulator.step(&row3(&batch.commands, b, k)));
            }
        }
    }
    Ok(outputs)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A point that goes on with its speed, pushed by the command.
    struct Point(Description, [f64; 2]);

    impl Stepped for Point {
        fn description(&self) -> &Description {
            &self.0
        }

        fn place(&mut self, _parameters: &[f64], motion: &[f64], _fresh: bool) -> Result<Vec<f64>, String> {
            self.1 = [motion[0], motion[1]];
            if motion[0] < 0.0 { Err("backwards".to_owned()) } else { Ok(motion.to_vec()) }
        }

        fn step(&mut self, command: &[f64]) -> Vec<f64> {
            self.1[1] += command[0];
            self.1.to_vec()
        }
    }

    fn point() -> Point {
        let states = vec![Channel::VXMps, Channel::VYMps];
        let description = Description {
            name: "point".to_owned(),
            step_s: 0.1,
            states: states.clone(),
            inputs: Vec::new(),
            outputs: states,
            parameters: Vec::new(),
            imposes_v_x: true,
            lacks: Vec::new(),
        };
        Point(description, [0.0; 2])
    }

    #[test]
    fn a_pass_places_kicks_imposes_and_steps() {
        let mut batch = Batch {
            parameters: Array2::zeros((2, 0)),
            commands: Array3::from_elem((1, 3, 1), 1.0),
            place_steps: Array1::from_vec(vec![0]),
            motions: Array3::from_shape_fn((1, 1, 2), |(_, _, s)| [5.0, 0.0][s]),
            v_x_mps: Some(Array2::from_shape_fn((1, 4), |(_, k)| 5.0 + k as f64)),
            kicks: Some(Array3::from_elem((1, 3, 2), 0.5)),
            output_steps: Array1::from_vec(vec![0, 1, 3]),
        };
        let outputs = rollout(&mut point(), &batch).unwrap();
        for b in 0..2 {
            let rows: Vec<Vec<f64>> =
                outputs.index_axis(ndarray::Axis(0), b).outer_iter().map(|r| r.to_vec()).collect();
            assert_eq!(rows, [[5.0, 0.0], [6.0, 1.5], [8.0, 4.5]]);
        }
        batch.motions.fill(-1.0);
        assert_eq!(rollout(&mut point(), &batch).unwrap_err(), "backwards");
    }
}
