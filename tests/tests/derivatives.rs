use hamel_codegen::scene;
use hamel_tests::models::{model, names};

#[test]
fn measure() {
    let only = std::env::var("ONLY").ok();
    for name in names() {
        if only.as_ref().is_some_and(|o| *o != name) { continue; }
        let model = model(&name);
        let start = std::time::Instant::now();
        let built = scene::build(&model, scene::DERIVATIVES).unwrap();
        let time = start.elapsed();
        let c = |n: &str| built.program.function_idx(n).map_or(0, |k| built.program.functions[k].counts().total());
        let r = c("rhs");
        let n = built.state.len();
        let default = scene::build(&model, scene::DEFAULT).unwrap();
        let d = &default.program; let rd = d.functions[d.function_idx("rhs").unwrap()].counts().total();
        println!("{name:24} n {n:3} nnz {:4} rhs {rd:4} {r:4} jac {:5} ({:.2}) jvp {:5} ({:.2}) vjp {:5} ({:.2}) dt {} sens {} ({:.2}) sjvp {} {:?}", built.matrices()[0].pattern.len(), c("jacobian"), c("jacobian") as f64/r as f64, c("jvp"), c("jvp") as f64/r as f64, c("vjp"), c("vjp") as f64/r as f64, c("time_derivative"), c("sensitivity"), c("sensitivity") as f64/r as f64, c("sensitivity_jvp"), time);
    }
}
