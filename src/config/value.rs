//! A value of a configuration file that knows where it stands: a check of it need not name its key.

/// Key and line of something in the file, or of where it would stand.
#[derive(Clone, Debug)]
pub struct Place {
    key: String,
    line: Option<usize>,
}

impl Place {
    /// A key like `joint[2].torque_curve`, and its line or that of the nearest table around it that is written down.
    pub const fn new(key: String, line: Option<usize>) -> Self {
        Self { key, line }
    }

    /// The whole key.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// The line, from 1.
    pub const fn line(&self) -> Option<usize> {
        self.line
    }

    /// The last part of the key.
    pub fn name(&self) -> &str {
        self.key.rsplit('.').next().unwrap_or_default()
    }
}

/// Something that knows where it stands.
pub trait Placed {
    /// Returns where.
    fn place(&self) -> &Place;
}

impl Placed for Place {
    fn place(&self) -> &Place {
        self
    }
}

/// Value at a key. A key that is `NEEDED` and absent is noted as a problem.
#[derive(Clone, Debug)]
pub struct Value<T, const NEEDED: bool = true> {
    place: Place,
    found: Found<T>,
}

/// The same of a key that may be absent.
pub type Optional<T> = Value<T, false>;

#[derive(Clone, Debug)]
enum Found<T> {
    Value(T),
    /// A value of another type, or a needed key that is absent: noted as a problem, once.
    Noted,
    Absent,
}

impl<T, const NEEDED: bool> Value<T, NEEDED> {
    pub const fn new(place: Place, value: T) -> Self {
        Self { place, found: Found::Value(value) }
    }

    /// A value that cannot be used, for which a problem has been noted.
    pub const fn noted(place: Place) -> Self {
        Self { place, found: Found::Noted }
    }

    /// A key that is not in the file, and need not be.
    pub const fn absent(place: Place) -> Self {
        Self { place, found: Found::Absent }
    }

    /// The value, if there is one.
    pub const fn as_ref(&self) -> Option<&T> {
        match &self.found {
            Found::Value(value) => Some(value),
            Found::Noted | Found::Absent => None,
        }
    }
}

impl<T: Copy, const NEEDED: bool> Value<T, NEEDED> {
    /// The value, if there is one.
    pub const fn get(&self) -> Option<T> {
        match self.found {
            Found::Value(value) => Some(value),
            Found::Noted | Found::Absent => None,
        }
    }
}

impl<T> Optional<T> {
    /// Returns whether the key is not in the file.
    pub const fn is_absent(&self) -> bool {
        matches!(self.found, Found::Absent)
    }
}

impl<T: Clone> Optional<T> {
    /// The same with what is `usual` where the key is absent.
    pub fn or(&self, usual: T) -> Value<T> {
        let found = match &self.found {
            Found::Absent => Found::Value(usual),
            found @ (Found::Value(_) | Found::Noted) => found.clone(),
        };
        Value { place: self.place.clone(), found }
    }
}

impl<T, const NEEDED: bool> Placed for Value<T, NEEDED> {
    fn place(&self) -> &Place {
        &self.place
    }
}
