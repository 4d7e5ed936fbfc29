fn main() -> anyhow::Result<()> {
    let bag = std::env::args().nth(1).unwrap();
    let veh = gripsight_vehicle::VehicleParameters::from_ros_yaml(&std::fs::read_to_string(std::env::args().nth(2).unwrap())?)?;
    let (seq, _) = gripsight_bag::read_sequences(bag.as_ref(), &Default::default(), gripsight_signals::WindowConfig{length_s: f64::INFINITY, hop_s: f64::INFINITY})?;
    if std::env::var("TRY").is_ok() {
    let rec = gripsight_gap::Recording::new(&seq[0])?;
    gripsight_gap::probe::probe(&rec, &veh, None); return Ok(()); }
    let t = std::time::Instant::now();
    let d = gripsight_gap::diagnose(&gripsight_gap::Request{sequence:&seq[0],held_out:None,reference:None,vehicle:&veh,tires:None,without:&[],only:&[]}, &mut |s| eprintln!("{:.2?} {s}", t.elapsed()))?;
    println!("{}", d.text());
    eprintln!("{:.2?}", t.elapsed());
    Ok(())
}
