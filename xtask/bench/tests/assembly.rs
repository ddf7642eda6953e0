//! What the compiler makes of the generated right-hand sides: straight-line code that can neither panic nor allocate.
//!
//! The functions of `hamel_bench::ours` are compiled as users compile them, optimised, to assembly text. Every symbol
//! that one of them refers to has to be a function of the mathematical library or local to it: no panic, no bounds
//! check, no allocation, no copy by a library, and no fused multiply-add by one.

use std::collections::{BTreeMap, BTreeSet};
use std::path::PathBuf;
use std::process::Command;

/// Functions that right-hand sides may call; not `fma`, which takes longer than the operations that it replaces.
const MATHEMATICAL: [&str; 15] = [
    "sin", "cos", "sincos", "tan", "asin", "acos", "atan", "atan2", "exp", "log", "sinh", "cosh", "tanh",
    "pow", "sqrt",
];

/// Names of the modules of all scenes.
macro_rules! modules {
    ($(($module:ident, $model:literal, $scene:literal, $n:literal))*) => { &[$(stringify!($module)),*] };
}
const MODULES: &[&str] = hamel_models::for_each_scene!(modules);

/// Part of the symbol of a function of `hamel_bench::ours`, in both ways in which the compiler spells symbols.
fn mangled(module: &str) -> String {
    format!("hamel_bench4ours{}{module}", module.len())
}

/// Instructions of each function by its symbol; a symbol that stands for another function has those of the other.
fn functions(assembly: &str) -> BTreeMap<&str, Vec<&str>> {
    let mut functions: BTreeMap<&str, Vec<&str>> = BTreeMap::new();
    let mut same: Vec<(&str, &str)> = Vec::new();
    let mut current = None;
    for line in assembly.lines() {
        let text = line.split_once("##").map_or(line, |(code, _)| code).trim();
        if let Some(label) = line.strip_suffix(':').filter(|l| !l.starts_with(char::is_whitespace)) {
            if !is_local(label) {
                current = Some(label);
                functions.entry(label).or_default();
            }
        } else if let Some((name, other)) = text.strip_prefix(".set").and_then(|set| set.split_once(',')) {
            same.push((name.trim(), other.trim()));
        } else if text.starts_with(".size") || text.starts_with(".section") {
            current = None;
        } else if !text.is_empty()
            && !text.starts_with(['.', '#', ';'])
            && let Some(function) = current.and_then(|name| functions.get_mut(name))
        {
            function.push(text);
        }
    }
    for (name, other) in same {
        if let Some(body) = functions.get(other).cloned() {
            functions.insert(name, body);
        }
    }
    functions
}

/// Labels of the assembler: `.L` in ELF and COFF, `L` in Mach-O, where other symbols begin with `_`.
fn is_local(symbol: &str) -> bool {
    symbol.starts_with(".L") || symbol.starts_with('L')
}

/// The symbols that an instruction refers to: where it calls or jumps to, and what it loads the address of.
fn references(instruction: &str) -> Vec<&str> {
    let (mnemonic, operands) = instruction.split_once(char::is_whitespace).unwrap_or((instruction, ""));
    let is_symbol = |c: char| c.is_ascii_alphanumeric() || "_.$".contains(c);
    let mut found = Vec::new();
    for operand in operands.split(',').map(str::trim) {
        let named = operand.trim_start_matches('*');
        let symbol = named.split(|c| !is_symbol(c)).next().unwrap_or_default();
        let is_branch = mnemonic.starts_with("call")
            || mnemonic.starts_with('j')
            || matches!(mnemonic, "b" | "bl")
            || mnemonic.starts_with("b.");
        // `call f`, `f@PLT`, `*f@GOTPCREL(%rip)`, `f(%rip)`, `:got:f`, `f@GOTPAGE`.
        if let Some((_, symbol)) = operand.rsplit_once(':').filter(|_| operand.starts_with([':', '['])) {
            found.push(symbol.trim_end_matches(']'));
        } else if !symbol.is_empty() && (is_branch || named.contains('@') || named.contains("(%rip)")) {
            found.push(symbol);
        }
    }
    found.retain(|symbol| !is_local(symbol));
    found
}

/// Symbols outside of a function that it refers to and must not.
fn forbidden<'a>(body: &[&'a str]) -> BTreeSet<&'a str> {
    // The runtime's own sine and cosine have a table, and a function for angles beyond their bound; traits' items are
    // spelled the second way.
    let own = ["hamel_bench4ours", "hamel_runtime4math", "hamel_runtime..math.."];
    let allowed = |symbol: &str| {
        let plain = symbol.strip_prefix('_').unwrap_or(symbol);
        MATHEMATICAL.contains(&plain) || own.iter().any(|path| symbol.contains(path))
    };
    let mut found: BTreeSet<&str> =
        body.iter().flat_map(|line| references(line)).filter(|symbol| !allowed(symbol)).collect();
    found.extend(body.iter().filter(|line| line.starts_with("ud2") || line.starts_with("brk")));
    found
}

#[test]
fn what_a_function_refers_to_is_found() {
    let elf = "\
\t.type\tf,@function
f:
\t.cfi_startproc
\tvmovsd\t.LCPI0_0(%rip), %xmm0
\tmovq\tsin@GOTPCREL(%rip), %rbx
\tcallq\t*%rbx
\tcallq\t*cos@GOTPCREL(%rip)
\tjae\t.LBB0_2
.LBB0_2:
\tleaq\t.Lanon.1(%rip), %rdx
\tcallq\t*_ZN4core9panicking18panic_bounds_check17hE@GOTPCREL(%rip)
\tjmp\tmemcpy@PLT
\tud2
\t.size\tf, .Lfunc_end0-f
\t.set\tg, f
";
    let functions = functions(elf);
    let expected = ["_ZN4core9panicking18panic_bounds_check17hE", "memcpy", "ud2"];
    for name in ["f", "g"] {
        assert!(forbidden(&functions[name]).into_iter().eq(expected), "{:?}", forbidden(&functions[name]));
    }
    let arm =
        ["adrp\tx8, :got:fma", "ldr\tx8, [x8, :got_lo12:fma]", "bl\t_sin", "bl\tmemcpy", "b.ne\t.LBB0_1"];
    assert!(forbidden(&arm).into_iter().eq(["fma", "memcpy"]), "{:?}", forbidden(&arm));
}

#[test]
fn no_right_hand_side_refers_to_anything_but_mathematical_functions() {
    let folder = PathBuf::from(env!("CARGO_TARGET_TMPDIR"));
    let file = folder.join("rhs.s");
    let manifest = concat!(env!("CARGO_MANIFEST_DIR"), "/Cargo.toml");
    let output = Command::new(env!("CARGO"))
        .args([
            "rustc",
            "--release",
            "--lib",
            "--no-default-features",
            "--features",
            "rhs",
            "--manifest-path",
            manifest,
        ])
        .arg("--target-dir")
        .arg(folder.join("assembly"))
        .args(["--", "-C", "codegen-units=1"])
        .arg(format!("--emit=asm={}", file.display()))
        .output()
        .expect("cargo can be started");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let assembly = std::fs::read_to_string(&file).unwrap_or_else(|e| panic!("{}: {e}", file.display()));
    let functions = functions(&assembly);
    let mut problems = Vec::new();
    let mut used = BTreeSet::new();
    let body_of = |module: &str| {
        let mangled = mangled(module);
        let body = functions.iter().find(|(symbol, _)| symbol.contains(&mangled)).map(|(_, body)| body)?;
        // What is too large to be inlined is a function of the models that this one jumps to.
        let there = match body.as_slice() {
            [jump] => references(jump).first().and_then(|symbol| functions.get(symbol)),
            _ => None,
        };
        Some(there.unwrap_or(body))
    };
    for module in MODULES {
        let Some(body) = body_of(module) else {
            // The compiler keeps one of several equal functions, as scenes of one model with the same right-hand side
            // are.
            let model = module.rsplit_once('_').map_or(*module, |(model, _)| model);
            let mut others = MODULES.iter().filter(|other| other.starts_with(model));
            assert!(others.any(|other| body_of(other).is_some()), "{module} is not in {}", file.display());
            continue;
        };
        assert!(body.len() > 1, "{module} has instructions");
        used.extend(body.iter().flat_map(|line| references(line)));
        for symbol in forbidden(body) {
            problems.push(format!("{module} refers to {symbol}"));
        }
    }
    assert!(problems.is_empty(), "{}", problems.join("\n"));
    // The angles of the disk: references are found in the real text as well.
    assert!(used.iter().any(|symbol| symbol.contains("hamel_runtime4math")), "{used:?}");
    println!("{} functions refer to {used:?} alone", MODULES.len());
}
