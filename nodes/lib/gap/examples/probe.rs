fn main() -> anyhow::Result<()> {
    let bag = std::env::args().nth(1).unwrap();
    let veh = gripsight_vehicle::VehicleParameters::from_ros_yaml(&std::fs::read_to_string(std::env::args().nth(2).unwrap())?)?;
    let (seq, _) = gripsight_bag::read_sequences(bag.as_ref(), &Default::default(), gripsight_signals::WindowConfig{length_s: f64::INFINITY, hop_s: f64::INFINITY})?;
    let rec = gripsight_gap::Recording::new(&seq[0])?;
    gripsight_gap::probe::probe(&rec, &veh, None);
    Ok(())
}
