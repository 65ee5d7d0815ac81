//! Reads what the tests need of a .safetensors file: F32 and I32 tensors and the metadata.
use std::collections::BTreeMap;
use std::path::Path;

use serde_json::Value;

pub struct SafeTensors {
    header: Value,
    data: Vec<u8>,
}

#[allow(dead_code)] // each test that includes this file uses its part
impl SafeTensors {
    pub fn read(path: impl AsRef<Path>) -> Self {
        let path = path.as_ref();
        let mut bytes = std::fs::read(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let length = u64::from_le_bytes(bytes[..8].try_into().expect("8 bytes")) as usize;
        let header = serde_json::from_slice(&bytes[8..8 + length]).expect("a JSON header");
        Self { header, data: bytes.split_off(8 + length) }
    }

    pub fn metadata(&self, key: &str) -> &str {
        self.header["__metadata__"][key].as_str().unwrap_or_else(|| panic!("metadata {key}"))
    }

    /// Metadata that is a JSON list of texts.
    pub fn names(&self, key: &str) -> Vec<String> {
        serde_json::from_str(self.metadata(key)).expect("a list of names")
    }

    /// Rows of N numbers each.
    pub fn f32<const N: usize>(&self, name: &str) -> Vec<[f32; N]> {
        self.rows(name, "F32", f32::from_le_bytes)
    }

    pub fn i32<const N: usize>(&self, name: &str) -> Vec<[i32; N]> {
        self.rows(name, "I32", i32::from_le_bytes)
    }

    pub fn shape(&self, name: &str) -> Vec<usize> {
        let shape = self.header[name]["shape"].as_array().unwrap_or_else(|| panic!("no tensor {name}"));
        shape.iter().map(|length| length.as_u64().expect("a length") as usize).collect()
    }

    fn rows<T: Copy, const N: usize>(&self, name: &str, kind: &str, number: fn([u8; 4]) -> T) -> Vec<[T; N]> {
        assert_eq!(self.header[name]["dtype"], kind, "{name}");
        let at = |end: usize| self.header[name]["data_offsets"][end].as_u64().expect("an offset") as usize;
        let numbers: Vec<T> =
            self.data[at(0)..at(1)].chunks_exact(4).map(|bytes| number(bytes.try_into().expect("4 bytes"))).collect();
        assert!(!numbers.is_empty() && numbers.len().is_multiple_of(N), "{name}: rows of {N}");
        numbers.chunks_exact(N).map(|row| std::array::from_fn(|i| row[i])).collect()
    }

    /// Writes F32 tensors and metadata.
    pub fn write(path: &Path, metadata: &BTreeMap<&str, String>, tensors: &[(&str, Vec<usize>, Vec<f32>)]) {
        let mut header = serde_json::Map::new();
        header.insert("__metadata__".into(), serde_json::json!(metadata));
        let mut data = Vec::new();
        for (name, shape, values) in tensors {
            assert_eq!(shape.iter().product::<usize>(), values.len(), "{name}");
            let start = data.len();
            data.extend(values.iter().flat_map(|value| value.to_le_bytes()));
            let entry = serde_json::json!({"dtype": "F32", "shape": shape, "data_offsets": [start, data.len()]});
            header.insert((*name).into(), entry);
        }
        let mut text = Value::Object(header).to_string();
        text.push_str(&" ".repeat(text.len().next_multiple_of(8) - text.len()));
        let mut bytes = (text.len() as u64).to_le_bytes().to_vec();
        bytes.extend(text.as_bytes());
        bytes.extend(data);
        std::fs::write(path, bytes).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
    }
}
