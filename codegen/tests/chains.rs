//! Chains of bodies.
#[path = "chains/families.rs"]
mod families;
use hamel_codegen::program::Role;
use hamel_codegen::reduction::Formulation;
use hamel_codegen::{scene, spec};

#[test]
fn measure() {
    let Ok(list) = std::env::var("CHAINS") else { return };
    for item in list.split_whitespace() {
        let parts: Vec<&str> = item.split(':').collect();
        let n: usize = parts[1].parse().unwrap();
        let text = match parts[0] {
            "snake" => families::wheeled_snake(n),
            "arm" => families::planar_arm(n),
            _ => families::planar_pendulum(n),
        };
        for chains in [true, false] {
            if !chains && parts.get(2).is_some() {
                continue;
            }
            let start = std::time::Instant::now();
            let model = spec::parse("m.hamel", &text).unwrap_or_else(|e| panic!("{e}"));
            let parsed = start.elapsed();
            let formulation = Formulation { chains: Some(chains), ..Formulation::of(&model) };
            let system = hamel_codegen::reduction::reduce(&model, &formulation).unwrap();
            let reduced = start.elapsed();
            let _ = hamel_codegen::mechanics::derive(&system).unwrap();
            let derived = start.elapsed();
            let built = scene::build_in(&model, "bare", &formulation).unwrap_or_else(|e| panic!("{e}"));
            let c = built.program.function(&Role::Rate).unwrap().counts();
            println!("{item} chains {chains}: {} / {} all {} cost {} in {parsed:?} {reduced:?} {derived:?} {:?}", c.add, c.mul, c.total(), c.cost(), start.elapsed());
            if std::env::var("TABLE").is_ok() {
                println!("{}", built.operation_columns());
            }
        }
    }
}
