fn main() {
    let path = std::env::args().nth(1).unwrap();
    let text = std::fs::read_to_string(&path).unwrap();
    let mut options = hamel_import::Options::default();
    options.limits = hamel_import::Limits::None;
    let r = hamel_import::import_with(&path, &text, &options, &hamel_import::beside(std::path::Path::new(&path)));
    match r {
        Ok(i) => {
            eprint!("{}", i.notes.render(false));
            print!("{}", i.text);
            if let Err(e) = hamel_lang::spec::parse("m.hamel", &i.text) { eprint!("PARSE {}", e.render(false)); std::process::exit(2); }
            else { eprint!("{}", hamel_lang::spec::parse("m.hamel", &i.text).unwrap().warnings.render(false)); }
        }
        Err(e) => { eprint!("ERROR {}", e.render(false)); std::process::exit(1); }
    }
}
