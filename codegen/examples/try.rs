use hamel_codegen::{spec, reduction, mechanics, expr::Style};
fn main() {
    for f in std::env::args().skip(1) {
        let t0 = std::time::Instant::now();
        let text = std::fs::read_to_string(&f).unwrap();
        let model = match spec::parse(&f, &text) { Ok(m) => m, Err(e) => { println!("{e}"); continue } };
        let sys = match reduction::reduce(&model, &[]) { Ok(m) => m, Err(e) => { println!("{e}"); continue } };
        match mechanics::derive(&sys) {
            Ok(eq) => {
                println!("== {} {:?} {:?}", eq.system.name, t0.elapsed(), eq.facts);
                for s in &eq.sections { println!("-- {}", s.title); for d in &s.definitions { println!("   {} = {}", eq.system.graph.name(d.symbol), eq.display(d.expr, Style::Unicode)); } }
                for s in &eq.state { println!("   {}' = {}", s.name, eq.display(s.derivative, Style::Unicode)); }
                println!("  E = {}", eq.display(eq.energy, Style::Unicode));
                println!("  Edot = {}", eq.display(eq.energy_rate, Style::Unicode));
                for p in &eq.pivots { println!("  pivot {} {}", p.name, eq.display(p.expr, Style::Unicode)); }
            }
            Err(e) => println!("{e}"),
        }
    }
}
