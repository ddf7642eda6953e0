//! JSON with the order and the repetitions of keys kept, and numbers by name with every problem reported at once.
//!
//! Does not know: which requests there are.

use std::collections::BTreeMap;
use std::collections::btree_map::Entry;
use std::fmt;

use serde::de::{Deserialize, Deserializer, Error as _, MapAccess, SeqAccess, Visitor};

use crate::error::{Error, Problem};
use crate::forms::{Form, Forms};

/// A JSON value.
#[derive(Clone, Debug, PartialEq)]
pub enum Json {
    /// `null`.
    Null,
    /// `true` or `false`.
    Bool(bool),
    /// A number, as the nearest double.
    Number(f64),
    /// A string.
    String(String),
    /// An array.
    Array(Vec<Json>),
    /// An object with its entries as written, repeated keys included.
    Object(Vec<(String, Json)>),
}

impl Json {
    /// Reads one JSON value.
    ///
    /// # Errors
    /// [`Error::NotJson`] with line and column.
    pub fn parse(text: &str) -> Result<Json, Error> {
        serde_json::from_str(text)
            .map_err(|e| Error::NotJson { reason: e.to_string(), empty: text.trim().is_empty() })
    }

    /// What the value is, for messages.
    pub fn describe(&self) -> String {
        match self {
            Json::Null => "null".into(),
            Json::Bool(b) => b.to_string(),
            Json::Number(x) => format!("the number {x:?}"),
            Json::String(s) => format!("the string {s:?}"),
            Json::Array(_) => "an array".into(),
            Json::Object(_) => "an object".into(),
        }
    }
}

impl<'de> Deserialize<'de> for Json {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Json, D::Error> {
        struct Values;
        impl<'de> Visitor<'de> for Values {
            type Value = Json;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("a JSON value")
            }

            fn visit_unit<E>(self) -> Result<Json, E> {
                Ok(Json::Null)
            }

            fn visit_bool<E>(self, b: bool) -> Result<Json, E> {
                Ok(Json::Bool(b))
            }

            fn visit_u64<E>(self, x: u64) -> Result<Json, E> {
                Ok(Json::Number(x as f64))
            }

            fn visit_i64<E>(self, x: i64) -> Result<Json, E> {
                Ok(Json::Number(x as f64))
            }

            fn visit_f64<E: serde::de::Error>(self, x: f64) -> Result<Json, E> {
                if x.is_finite() { Ok(Json::Number(x)) } else { Err(E::custom("number out of range")) }
            }

            fn visit_str<E>(self, s: &str) -> Result<Json, E> {
                Ok(Json::String(s.to_owned()))
            }

            fn visit_seq<A: SeqAccess<'de>>(self, mut seq: A) -> Result<Json, A::Error> {
                let mut items = Vec::new();
                while let Some(item) = seq.next_element()? {
                    items.push(item);
                }
                Ok(Json::Array(items))
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<Json, A::Error> {
                let mut entries = Vec::new();
                while let Some(entry) = map.next_entry()? {
                    entries.push(entry);
                }
                Ok(Json::Object(entries))
            }
        }
        deserializer.deserialize_any(Values).map_err(D::Error::custom)
    }
}

/// Reads the fields of a request, collecting problems instead of stopping at the first.
#[derive(Debug)]
pub struct Fields {
    entries: Vec<(String, Json)>,
    /// What is wrong so far.
    pub problems: Vec<Problem>,
}

impl Fields {
    /// The fields of an object; every field is one of `known`.
    ///
    /// # Errors
    /// [`Error::Request`] when the value is not an object.
    pub fn new(value: Json, known: &[&'static str]) -> Result<Fields, Error> {
        let Json::Object(entries) = value else {
            let found = value.describe();
            return Err(Error::Request {
                problems: vec![Problem::WrongKind { path: "the request".into(), found, wanted: "an object" }],
            });
        };
        let mut problems = Vec::new();
        let mut kept: Vec<(String, Json)> = Vec::new();
        for (name, value) in entries {
            if !known.contains(&name.as_str()) {
                let known = known.iter().map(|k| (*k).to_owned()).collect();
                problems.push(Problem::UnknownName {
                    path: "the request".into(),
                    kind: "field",
                    name,
                    known,
                });
            } else if kept.iter().any(|(k, _)| *k == name) {
                problems.push(Problem::Repeated { path: "the request".into(), name });
            } else {
                kept.push((name, value));
            }
        }
        Ok(Fields { entries: kept, problems })
    }

    /// Takes a field; `null` is like absence.
    pub fn take(&mut self, name: &str) -> Option<Json> {
        let at = self.entries.iter().position(|(k, _)| k == name)?;
        let (_, value) = self.entries.remove(at);
        (value != Json::Null).then_some(value)
    }

    /// Takes a number.
    pub fn number(&mut self, name: &str) -> Option<f64> {
        let value = self.take(name)?;
        self.as_number(name.to_owned(), value)
    }

    /// Takes a string.
    pub fn string(&mut self, name: &str) -> Option<String> {
        match self.take(name)? {
            Json::String(s) => Some(s),
            other => {
                self.wrong(name, &other, "a string");
                None
            }
        }
    }

    /// Takes an array.
    pub fn array(&mut self, name: &str) -> Option<Vec<Json>> {
        match self.take(name)? {
            Json::Array(items) => Some(items),
            other => {
                self.wrong(name, &other, "an array");
                None
            }
        }
    }

    /// Notes that a field is absent and has no default.
    pub fn missing(&mut self, name: &str, meaning: &'static str) {
        self.problems.push(Problem::MissingField { name: name.to_owned(), meaning });
    }

    fn wrong(&mut self, path: &str, found: &Json, wanted: &'static str) {
        self.problems.push(Problem::WrongKind { path: path.to_owned(), found: found.describe(), wanted });
    }

    fn as_number(&mut self, path: String, value: Json) -> Option<f64> {
        match value {
            Json::Number(x) => Some(x),
            Json::String(text) => {
                self.problems.push(Problem::QuotedNumber { path, text });
                None
            }
            other => {
                self.wrong(&path, &other, "a number");
                None
            }
        }
    }

    /// A whole state in one of its forms, which comes with it; the last `n_group` components are given elsewhere.
    pub fn state(
        &mut self,
        path: &str,
        value: Option<Json>,
        forms: &Forms,
        n_group: usize,
    ) -> (Vec<f64>, Form) {
        let given = names_in(value.as_ref());
        let form = forms.form_of(given).unwrap_or_else(|reason| {
            self.problems.push(Problem::Unusable { path: path.to_owned(), reason });
            forms.own_form()
        });
        let names = forms.names(&form);
        let n_own = names.len() - n_group;
        let names: Vec<&str> = names.iter().map(String::as_str).collect();
        let known: Vec<&str> =
            forms.known().into_iter().filter(|name| !names[n_own..].contains(name)).collect();
        (self.numbers_among(path, value, ("state", &known), &names[..n_own], None), form)
    }

    /// Some numbers by name, of those in `known`.
    pub fn some_numbers(
        &mut self,
        path: &str,
        value: Option<Json>,
        kind: &'static str,
        known: &[&str],
    ) -> BTreeMap<String, f64> {
        let mut values = BTreeMap::new();
        let entries = match value {
            Some(Json::Object(entries)) => entries,
            Some(other) => {
                self.wrong(path, &other, "an object of numbers by name");
                return values;
            }
            None => return values,
        };
        for (name, value) in entries {
            if !known.contains(&name.as_str()) {
                let known = known.iter().map(|n| (*n).to_owned()).collect();
                self.problems.push(Problem::UnknownName { path: path.to_owned(), kind, name, known });
                continue;
            }
            let number = self.as_number(format!("{path}.{name}"), value);
            match values.entry(name) {
                Entry::Occupied(entry) => {
                    let name = entry.key().clone();
                    self.problems.push(Problem::Repeated { path: path.to_owned(), name });
                }
                Entry::Vacant(entry) => _ = number.map(|x| entry.insert(x)),
            }
        }
        values
    }

    /// Numbers by name in the order of `names`; without `defaults` every name has to be there.
    pub fn numbers(
        &mut self,
        path: &str,
        value: Option<Json>,
        kind: &'static str,
        names: &[&str],
        defaults: Option<&[f64]>,
    ) -> Vec<f64> {
        self.numbers_among(path, value, (kind, names), names, defaults)
    }

    /// The same, where messages tell of all names `known`.
    fn numbers_among(
        &mut self,
        path: &str,
        value: Option<Json>,
        (kind, all): (&'static str, &[&str]),
        names: &[&str],
        defaults: Option<&[f64]>,
    ) -> Vec<f64> {
        let fallback = || defaults.map_or_else(|| vec![0.0; names.len()], <[f64]>::to_vec);
        let entries = match value {
            Some(Json::Object(entries)) => entries,
            Some(other) => {
                self.wrong(path, &other, "an object of numbers by name");
                return fallback();
            }
            None => Vec::new(),
        };
        let mut values = fallback();
        let mut given = vec![false; names.len()];
        for (name, value) in entries {
            let Some(at) = names.iter().position(|n| *n == name) else {
                // A name of another form, which the form that was chosen lacks, has been told of.
                if all.contains(&name.as_str()) {
                    continue;
                }
                let known = all.iter().map(|n| (*n).to_owned()).collect();
                self.problems.push(Problem::UnknownName { path: path.to_owned(), kind, name, known });
                continue;
            };
            if std::mem::replace(&mut given[at], true) {
                self.problems.push(Problem::Repeated { path: path.to_owned(), name });
            } else if let Some(x) = self.as_number(format!("{path}.{name}"), value) {
                values[at] = x;
            }
        }
        if defaults.is_none() && given.contains(&false) {
            let absent = names.iter().zip(&given).filter(|(_, g)| !**g).map(|(n, _)| (*n).to_owned());
            self.problems.push(Problem::MissingNames {
                path: path.to_owned(),
                absent: absent.collect(),
                known: names.iter().map(|n| (*n).to_owned()).collect(),
            });
        }
        values
    }

    /// Fails when anything was wrong.
    ///
    /// # Errors
    /// [`Error::Request`] with all problems.
    pub fn finish(self) -> Result<(), Error> {
        if self.problems.is_empty() { Ok(()) } else { Err(Error::Request { problems: self.problems }) }
    }
}

/// The names in an object of numbers by name.
pub fn names_in(value: Option<&Json>) -> Vec<&str> {
    match value {
        Some(Json::Object(entries)) => entries.iter().map(|(name, _)| name.as_str()).collect(),
        _ => Vec::new(),
    }
}

/// A double as a JSON number in shortest round-trip form.
///
/// # Panics
/// For a number that is not finite: such numbers are errors long before.
pub fn number(x: f64) -> serde_json::Value {
    serde_json::Number::from_f64(x).expect("finite number").into()
}

/// An object of numbers by name.
pub fn by_name<'a>(names: impl IntoIterator<Item = &'a str>, values: &[f64]) -> serde_json::Value {
    names.into_iter().zip(values).map(|(name, x)| (name.to_owned(), number(*x))).collect()
}
