//! Every declaration against `engine/abi.json`, which is generated from the headers.
use super::{CONSTANTS, FUNCTIONS, Function, STRUCTS, Struct};
use serde_json::Value;

// What the crate leaves out: scenes, timers, ticks and half floats.
const LEFT_OUT_FUNCTIONS: &[&str] = &[
    "dcloth_scene_",
    "dcloth_cloth_tick",
    "dcloth_cloth_skin",
    "dcloth_model_output",
    "dcloth_output_scratch_size",
    "dcloth_version_number",
];
const LEFT_OUT_STRUCTS: &[&str] = &["dcloth_scene_", "dcloth_timer"];
const LEFT_OUT_CONSTANTS: &[&str] = &[
    "DCLOTH_DRAW_",
    "DCLOTH_LEVEL_",
    "DCLOTH_SCENE_",
    "DCLOTH_STEP_",
    "DCLOTH_TIMER_",
    "DCLOTH_FORMAT_",
    "DCLOTH_VERSION_",
    "DCLOTH_MAX_TICKS",
];

fn manifest() -> Value {
    let path = concat!(env!("CARGO_MANIFEST_DIR"), "/../../../engine/abi.json");
    serde_json::from_str(&std::fs::read_to_string(path).expect(path)).expect("abi.json is JSON")
}

fn left_out(name: &str, list: &[&str]) -> bool {
    list.iter().any(|start| name.starts_with(start))
}

/// A Rust type as C writes it.
fn in_c(rust: &str) -> String {
    let rust = rust.trim();
    if let Some(target) = rust.strip_prefix("*const ") {
        // A pointer to const: `const T*` for a plain T, `T const*` where T is a pointer itself.
        return if target.starts_with('*') {
            format!("{} const*", in_c(target))
        } else {
            format!("const {}*", in_c(target))
        };
    }
    if let Some(target) = rust.strip_prefix("*mut ") {
        return format!("{}*", in_c(target));
    }
    if let Some(array) = rust.strip_prefix('[') {
        let (of, count) = array.trim_end_matches(']').split_once(';').expect("an array");
        return format!("{}[{}]", in_c(of), count.trim());
    }
    match rust {
        "u16" => "uint16_t",
        "u32" => "uint32_t",
        "i32" => "int32_t",
        "u64" => "uint64_t",
        "f32" => "float",
        "usize" => "size_t",
        "c_char" => "char",
        "c_void" => "void",
        other => other,
    }
    .to_string()
}

fn signature((name, result, arguments): &Function) -> String {
    let arguments: Vec<String> = arguments.iter().map(|(name, of)| format!("{} {name}", in_c(of))).collect();
    let arguments = if arguments.is_empty() { "void".to_string() } else { arguments.join(", ") };
    format!("{} {name}({arguments})", in_c(result))
}

/// What differs between declarations and manifest.
fn differences(structs: &[Struct], functions: &[Function], constants: &[(&str, i64)], manifest: &Value) -> Vec<String> {
    let mut found = Vec::new();
    let objects = |key: &str| manifest[key].as_object().unwrap_or_else(|| panic!("abi.json has {key}")).clone();
    assert_eq!(manifest["pointer_bytes"], size_of::<*const u8>());

    let expected = objects("structs");
    for of in structs {
        let Some(c) = expected.get(of.name) else {
            found.push(format!("{}: not in abi.json", of.name));
            continue;
        };
        if c["bytes"] != of.bytes {
            found.push(format!("{}: {} bytes, in C {}", of.name, of.bytes, c["bytes"]));
        }
        let fields = c["fields"].as_array().expect("fields");
        if fields.len() != of.fields.len() {
            found.push(format!("{}: {} fields, in C {}", of.name, of.fields.len(), fields.len()));
        }
        for ((name, offset, bytes, kind), field) in of.fields.iter().zip(fields) {
            let same = field["name"] == *name && field["offset"] == *offset && field["bytes"] == *bytes;
            if !same || field["type"] != in_c(kind) {
                found.push(format!("{}.{name}: {} at {offset}, {bytes} bytes; in C {field}", of.name, in_c(kind)));
            }
        }
    }
    for (name, _) in &expected {
        if !left_out(name, LEFT_OUT_STRUCTS) && !structs.iter().any(|of| of.name == name) {
            found.push(format!("{name}: a struct that is not declared"));
        }
    }

    let expected = objects("functions");
    for function in functions {
        if expected.get(function.0).and_then(Value::as_str) != Some(&signature(function)) {
            found.push(format!("{}; in C {:?}", signature(function), expected.get(function.0)));
        }
    }
    for (name, _) in &expected {
        if !left_out(name, LEFT_OUT_FUNCTIONS) && !functions.iter().any(|function| function.0 == name) {
            found.push(format!("{name}: a function that is not declared"));
        }
    }

    let expected = objects("constants");
    for (name, value) in constants {
        if expected.get(*name).and_then(Value::as_i64) != Some(*value) {
            found.push(format!("{name} = {value}; in C {:?}", expected.get(*name)));
        }
    }
    for (name, _) in &expected {
        if !left_out(name, LEFT_OUT_CONSTANTS) && !constants.iter().any(|constant| constant.0 == name) {
            found.push(format!("{name}: a constant that is not declared"));
        }
    }
    found
}

#[test]
fn declarations_are_those_of_the_headers() {
    let fields: usize = STRUCTS.iter().map(|of| of.fields.len()).sum();
    assert!(STRUCTS.len() > 7 && fields > 80 && FUNCTIONS.len() > 25 && CONSTANTS.len() > 50);
    assert_eq!(differences(STRUCTS, FUNCTIONS, CONSTANTS, &manifest()), Vec::<String>::new());
}

/// A manifest that was changed in one place is not the declarations'.
#[test]
fn seeded_faults_are_found() {
    let mut seeded = 0;
    let mut check = |what: String, changed: &Value| {
        seeded += 1;
        assert!(!differences(STRUCTS, FUNCTIONS, CONSTANTS, changed).is_empty(), "not found: {what}");
    };
    for of in STRUCTS {
        for at in 0..of.fields.len() {
            for key in ["offset", "bytes", "name", "type"] {
                let mut changed = manifest();
                let value = &mut changed["structs"][of.name]["fields"][at][key];
                *value = value.as_i64().map_or(Value::from("other"), |number| Value::from(number + 1));
                check(format!("{}, field {at}, {key}", of.name), &changed);
            }
        }
        let mut changed = manifest();
        changed["structs"][of.name]["fields"].as_array_mut().expect("fields").pop();
        check(format!("{}: a field fewer", of.name), &changed);
    }
    for (name, _, _) in FUNCTIONS {
        let mut changed = manifest();
        changed["functions"][name] =
            changed["functions"][name].as_str().expect("text").replace(')', ", int more)").into();
        check(format!("{name}: an argument more"), &changed);
    }
    for (name, value) in CONSTANTS {
        let mut changed = manifest();
        changed["constants"][name] = (value + 1).into();
        check(format!("{name} + 1"), &changed);
    }
    let mut changed = manifest();
    changed["functions"]["dcloth_cloth_new"] = "void dcloth_cloth_new(void)".into();
    check("a new function".to_string(), &changed);
    assert!(seeded > 400, "{seeded} faults");
}
