//! Values of a configuration file with key and line, so that checks report the place without naming it.

/// Key and line of a value in the file; for an absent key, the line of its table.
#[derive(Clone, Debug)]
pub struct Place {
    key: String,
    line: Option<usize>,
}

impl Place {
    /// Returns the place of a key such as `joint[2].torque_curve`, at the line of the key, or of the innermost table
    /// around it.
    pub const fn new(key: String, line: Option<usize>) -> Self {
        Self { key, line }
    }

    /// Returns the full key, such as `joint[2].torque_curve`.
    pub fn key(&self) -> &str {
        &self.key
    }

    /// Returns the line, from 1, if known.
    pub const fn line(&self) -> Option<usize> {
        self.line
    }

    /// Returns the last component of the key.
    pub fn name(&self) -> &str {
        self.key.rsplit('.').next().unwrap_or_default()
    }
}

/// Value, section or table with a place in the file.
pub trait HasPlace {
    /// Returns key and line.
    fn place(&self) -> &Place;
}

impl HasPlace for Place {
    fn place(&self) -> &Place {
        self
    }
}

/// Value at a key. Reading an absent key is a problem if it is `NEEDED`.
#[derive(Clone, Debug)]
pub struct Value<T, const NEEDED: bool = true> {
    place: Place,
    found: KeyState<T>,
}

/// Value at an optional key.
pub type Optional<T> = Value<T, false>;

#[derive(Clone, Debug)]
enum KeyState<T> {
    Value(T),
    /// Value of another type, or absent required key; already noted as a problem.
    Noted,
    Absent,
}

impl<T, const NEEDED: bool> Value<T, NEEDED> {
    pub const fn new(place: Place, value: T) -> Self {
        Self { place, found: KeyState::Value(value) }
    }

    /// Returns an unusable value that was noted as a problem.
    pub const fn noted(place: Place) -> Self {
        Self { place, found: KeyState::Noted }
    }

    /// Returns the value of an absent optional key.
    pub const fn absent(place: Place) -> Self {
        Self { place, found: KeyState::Absent }
    }

    /// Returns a reference to the value; `None` if it is absent or was noted as a problem.
    pub const fn as_ref(&self) -> Option<&T> {
        match &self.found {
            KeyState::Value(value) => Some(value),
            KeyState::Noted | KeyState::Absent => None,
        }
    }
}

impl<T: Copy, const NEEDED: bool> Value<T, NEEDED> {
    /// Returns the value; `None` if it is absent or was noted as a problem.
    pub const fn get(&self) -> Option<T> {
        match self.found {
            KeyState::Value(value) => Some(value),
            KeyState::Noted | KeyState::Absent => None,
        }
    }
}

impl<T> Optional<T> {
    /// Returns whether the key is absent from the file.
    pub const fn is_absent(&self) -> bool {
        matches!(self.found, KeyState::Absent)
    }
}

impl<T: Clone> Optional<T> {
    /// Returns the value, or `default` if the key is absent. A noted problem remains noted.
    pub fn or(&self, default: T) -> Value<T> {
        let found = match &self.found {
            KeyState::Absent => KeyState::Value(default),
            found @ (KeyState::Value(_) | KeyState::Noted) => found.clone(),
        };
        Value { place: self.place.clone(), found }
    }
}

impl<T, const NEEDED: bool> HasPlace for Value<T, NEEDED> {
    fn place(&self) -> &Place {
        &self.place
    }
}
