//! scratch
use hamel_codegen::{explain, expr::Style, scene, spec};
fn main() {
    for f in std::env::args().skip(1) {
        let t0 = std::time::Instant::now();
        let text = std::fs::read_to_string(&f).unwrap();
        let model = match spec::parse(&f, &text) {
            Ok(m) => m,
            Err(e) => {
                println!("{e}");
                continue;
            }
        };
        for s in scene::names(&model) {
            match scene::build(&model, &s) {
                Ok(b) => {
                    println!("#### {:?}", t0.elapsed());
                    println!("{}", explain::explain(&model, &b, Style::Unicode));
                }
                Err(e) => println!("{e}"),
            }
        }
    }
}
