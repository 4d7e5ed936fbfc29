//! modelDescription.xml.

use gripsight_model::DrivenCar;
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};
use sha2::{Digest as _, Sha256};

use crate::{FmuError, Role, Variable, variables};

/// Name of the shared object in the unit.
pub(crate) const IDENTIFIER: &str = "gripsight_car";
/// Step that a simulation takes where nobody says otherwise.
const STEP_S: &str = "0.01";

/// Version of the interface.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Version {
    /// FMI 2.0.
    Two,
    /// FMI 3.0.
    Three,
}

impl Version {
    pub(crate) fn platform(self) -> &'static str {
        match self {
            Self::Two => "linux64",
            Self::Three => "x86_64-linux",
        }
    }
}

/// Units by base units: name, then exponents of kg, m, s, rad.
const UNITS: [(&str, [i32; 4]); 10] = [
    ("s", [0, 0, 1, 0]),
    ("m", [0, 1, 0, 0]),
    ("m/s", [0, 1, -1, 0]),
    ("m/s2", [0, 1, -2, 0]),
    ("m/s3", [0, 1, -3, 0]),
    ("rad", [0, 0, 0, 1]),
    ("rad/s", [0, 0, -1, 1]),
    ("rad/s2", [0, 0, -2, 1]),
    ("1/rad", [0, 0, 0, -1]),
    ("kg", [1, 0, 0, 0]),
];
const INERTIA: (&str, [i32; 4]) = ("kg.m2", [1, 2, 0, 0]);

type Xml = Writer<Vec<u8>>;
type Written = std::io::Result<()>;

/// The description of a car's unit; `text` is the car's file, by which units are told apart.
pub(crate) fn description(version: Version, car: &DrivenCar, text: &str) -> Result<String, FmuError> {
    let token: String = Sha256::digest(text.as_bytes()).iter().map(|b| format!("{b:02x}")).collect();
    let table = variables(car);
    let mut xml = Writer::new_with_indent(Vec::new(), b' ', 2);
    write(&mut xml, version, &table, &token).map_err(FmuError::io("modelDescription.xml".as_ref()))?;
    Ok(String::from_utf8_lossy(&xml.into_inner()).into_owned() + "\n")
}

fn write(xml: &mut Xml, version: Version, table: &[Variable], token: &str) -> Written {
    let tool = format!("gripsight {}", env!("CARGO_PKG_VERSION"));
    let (number, token_name) = match version {
        Version::Two => ("2.0", "guid"),
        Version::Three => ("3.0", "instantiationToken"),
    };
    let attributes = [
        ("fmiVersion", number),
        ("modelName", "gripsight car"),
        (token_name, token),
        ("description", "Single-track car with the tires and effects that gripsight found"),
        ("generationTool", &tool),
        ("variableNamingConvention", "structured"),
    ];
    let steps = [
        ("modelIdentifier", IDENTIFIER),
        ("canHandleVariableCommunicationStepSize", "false"),
        (if version == Version::Two { "canGetAndSetFMUstate" } else { "canGetAndSetFMUState" }, "true"),
    ];
    xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
    xml.create_element("fmiModelDescription").with_attributes(attributes).write_inner_content(|xml| {
        xml.create_element("CoSimulation").with_attributes(steps).write_empty()?;
        xml.create_element("UnitDefinitions").write_inner_content(units)?;
        xml.create_element("DefaultExperiment")
            .with_attributes([("startTime", "0"), ("stepSize", STEP_S)])
            .write_empty()?;
        xml.create_element("ModelVariables").write_inner_content(|xml| {
            table.iter().enumerate().try_for_each(|(reference, v)| variable(xml, version, reference, v))
        })?;
        xml.create_element("ModelStructure").write_inner_content(|xml| structure(xml, version, table))?;
        Ok(())
    })?;
    Ok(())
}

fn units(xml: &mut Xml) -> Written {
    for (name, exponents) in UNITS.into_iter().chain([INERTIA]) {
        let base = ["kg", "m", "s", "rad"].into_iter().zip(exponents).filter(|(_, e)| *e != 0);
        let base: Vec<(&str, String)> = base.map(|(unit, e)| (unit, e.to_string())).collect();
        xml.create_element("Unit").with_attribute(("name", name)).write_inner_content(|xml| {
            let of = base.iter().map(|(unit, e)| (*unit, e.as_str()));
            xml.create_element("BaseUnit").with_attributes(of).write_empty()?;
            Ok(())
        })?;
    }
    Ok(())
}

fn variable(xml: &mut Xml, version: Version, reference: usize, v: &Variable) -> Written {
    let (causality, variability) = match v.role {
        Role::Time => ("independent", "continuous"),
        Role::Parameter => ("parameter", "fixed"),
        Role::Input => ("input", "continuous"),
        Role::Output => ("output", "continuous"),
    };
    let reference = reference.to_string();
    let common = [
        ("name", v.name.as_str()),
        ("valueReference", &reference),
        ("causality", causality),
        ("variability", variability),
        ("description", v.description),
    ];
    let start = match v.role {
        Role::Time | Role::Output => None,
        _ if v.is_switch => Some(if v.start == 0.0 { "false".to_owned() } else { "true".to_owned() }),
        _ => Some(format!("{:?}", v.start)),
    };
    let unit = Some(v.unit).filter(|unit| *unit != "1");
    let typed = unit.map(|u| ("unit", u)).into_iter().chain(start.as_deref().map(|s| ("start", s)));
    match version {
        Version::Three => {
            let name = if v.is_switch { "Boolean" } else { "Float64" };
            xml.create_element(name).with_attributes(common.into_iter().chain(typed)).write_empty()?;
        }
        Version::Two => {
            let name = if v.is_switch { "Boolean" } else { "Real" };
            xml.create_element("ScalarVariable").with_attributes(common).write_inner_content(|xml| {
                xml.create_element(name).with_attributes(typed).write_empty()?;
                Ok(())
            })?;
        }
    }
    Ok(())
}

fn structure(xml: &mut Xml, version: Version, table: &[Variable]) -> Written {
    let outputs = || table.iter().enumerate().filter(|(_, v)| v.role == Role::Output).map(|(i, _)| i);
    match version {
        Version::Three => {
            for name in ["Output", "InitialUnknown"] {
                for i in outputs() {
                    xml.create_element(name)
                        .with_attribute(("valueReference", i.to_string().as_str()))
                        .write_empty()?;
                }
            }
        }
        Version::Two => {
            for name in ["Outputs", "InitialUnknowns"] {
                xml.create_element(name).write_inner_content(|xml| {
                    for i in outputs() {
                        // Counted from 1.
                        xml.create_element("Unknown")
                            .with_attribute(("index", (i + 1).to_string().as_str()))
                            .write_empty()?;
                    }
                    Ok(())
                })?;
            }
        }
    }
    Ok(())
}
