//! DBC file of a network, for cantools, SavvyCAN or CANdb++.
//!
//! [`messages`] defines the content, this file the format. The output is plain ASCII, as tools differ at anything
//! else: `Nm` replaces N·m. There is no multiplexing: SDO segments carry data where other frames name the object.

pub mod messages;

use std::fmt;

/// Content of a DBC file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Database {
    /// Nodes with their comments.
    pub nodes: Vec<(String, String)>,
    /// Messages in ascending order of their identifiers, from [`messages::database`].
    pub messages: Vec<Message>,
}

/// Frame with its signals (`BO_`).
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Identifier, 11 or 29 bits by `format`.
    pub id: u32,
    /// Classical CAN or CAN FD.
    pub format: Format,
    /// C identifier: `TPDO1_elbow`, `Heartbeat_master`.
    pub name: String,
    /// Length, in bytes.
    pub bytes: usize,
    /// Name of the sending node.
    pub sender: String,
    /// Description (`CM_ BO_`); none is written if empty.
    pub comment: String,
    /// Cycle time in ms, for a periodic message.
    pub cycle_ms: Option<u32>,
    /// Signals in the data (`SG_`).
    pub fields: Vec<Field>,
}

/// Frame format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    /// Classical CAN with an 11-bit identifier.
    #[default]
    Standard,
    /// CAN FD with a 29-bit identifier.
    ExtendedFd,
}

/// Number format of a signal.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Number {
    /// Plain binary.
    #[default]
    Unsigned,
    /// Two's complement.
    Signed,
    /// IEEE 754 double, 64 bits.
    Double,
}

/// Signal of a message (`SG_`).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Field {
    /// C identifier, unique in its message.
    pub name: String,
    /// Start bit, little-endian.
    pub start: u16,
    /// Length in bits.
    pub bits: u16,
    /// Signed, unsigned or floating point.
    pub number: Number,
    /// Factor; zero is written as one.
    pub step: f64,
    /// Physical value of raw 0, in `unit`.
    pub offset: f64,
    /// Range of values; equal limits if unknown.
    pub range: [f64; 2],
    /// Physical unit in ASCII; empty for a plain number.
    pub unit: &'static str,
    /// Names of the receiving nodes.
    pub receivers: Vec<String>,
    /// Raw values with their names (`VAL_`).
    pub values: Vec<(i64, &'static str)>,
    /// Description (`CM_ SG_`); none is written if empty.
    pub comment: String,
}

/// Bit 31 of an identifier in a DBC file: extended identifier.
const EXTENDED: u32 = 1 << 31;

impl Message {
    const fn id(&self) -> u32 {
        match self.format {
            Format::Standard => self.id,
            Format::ExtendedFd => self.id | EXTENDED,
        }
    }

    /// Index in the list of `VFrameFormat`.
    const fn frame_format(&self) -> u8 {
        match self.format {
            Format::Standard => 0,
            Format::ExtendedFd => 15,
        }
    }
}

/// Values of `VFrameFormat`; unused ones are `reserved`.
const FRAME_FORMATS: [&str; 16] = {
    let mut formats = ["reserved"; 16];
    formats[0] = "StandardCAN";
    formats[1] = "ExtendedCAN";
    formats[14] = "StandardCAN_FD";
    formats[15] = "ExtendedCAN_FD";
    formats
};

impl fmt::Display for Database {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("VERSION \"\"\n\nNS_ :\n\nBS_:\n\nBU_:")?;
        self.nodes.iter().try_for_each(|(name, _)| write!(f, " {name}"))?;
        f.write_str("\n\n")?;
        for message in &self.messages {
            let Message { name, bytes, sender, .. } = message;
            writeln!(f, "BO_ {} {name}: {bytes} {sender}", message.id())?;
            message.fields.iter().try_for_each(|field| writeln!(f, "{field}"))?;
            f.write_str("\n")?;
        }
        self.comments(f)?;
        self.attributes(f)?;
        self.values(f)
    }
}

impl Database {
    fn comments(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (name, comment) in self.nodes.iter().filter(|(_, comment)| !comment.is_empty()) {
            writeln!(f, "CM_ BU_ {name} \"{}\";", Ascii(comment))?;
        }
        for message in &self.messages {
            let id = message.id();
            if !message.comment.is_empty() {
                writeln!(f, "CM_ BO_ {id} \"{}\";", Ascii(&message.comment))?;
            }
            for Field { name, comment, .. } in
                message.fields.iter().filter(|field| !field.comment.is_empty())
            {
                writeln!(f, "CM_ SG_ {id} {name} \"{}\";", Ascii(comment))?;
            }
        }
        f.write_str("\n")
    }

    fn attributes(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(
            "BA_DEF_ BO_ \"GenMsgCycleTime\" INT 0 65535;\nBA_DEF_ BO_ \"VFrameFormat\" ENUM ",
        )?;
        let mut separator = "";
        for format in FRAME_FORMATS {
            write!(f, "{separator}\"{format}\"")?;
            separator = ",";
        }
        let is_fd = self.messages.iter().any(|message| message.format == Format::ExtendedFd);
        f.write_str(";\nBA_DEF_ \"BusType\" STRING;\n")?;
        f.write_str("BA_DEF_DEF_ \"GenMsgCycleTime\" 0;\n")?;
        f.write_str("BA_DEF_DEF_ \"VFrameFormat\" \"StandardCAN\";\n")?;
        f.write_str("BA_DEF_DEF_ \"BusType\" \"CAN\";\n")?;
        writeln!(f, "BA_ \"BusType\" \"{}\";", if is_fd { "CAN FD" } else { "CAN" })?;
        for message in &self.messages {
            let id = message.id();
            if let Some(cycle) = message.cycle_ms {
                writeln!(f, "BA_ \"GenMsgCycleTime\" BO_ {id} {cycle};")?;
            }
            if message.format != Format::Standard {
                writeln!(f, "BA_ \"VFrameFormat\" BO_ {id} {};", message.frame_format())?;
            }
        }
        f.write_str("\n")
    }

    fn values(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for message in &self.messages {
            let id = message.id();
            for Field { name, values, .. } in
                message.fields.iter().filter(|field| !field.values.is_empty())
            {
                write!(f, "VAL_ {id} {name}")?;
                values
                    .iter()
                    .try_for_each(|(value, text)| write!(f, " {value} \"{}\"", Ascii(text)))?;
                f.write_str(" ;\n")?;
            }
            for field in message.fields.iter().filter(|field| field.number == Number::Double) {
                writeln!(f, "SIG_VALTYPE_ {id} {} : 2;", field.name)?;
            }
        }
        Ok(())
    }
}

/// ` SG_ elbow_torque : 48|16@1- (0.0001307,0) [-4.28|4.28] "Nm" master`
impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { name, start, bits, number, step, offset, range: [low, high], unit, .. } = self;
        let sign = match number {
            Number::Unsigned => '+',
            Number::Signed | Number::Double => '-',
        };
        let step = if step.abs() > 0.0 { *step } else { 1.0 };
        write!(f, " SG_ {name} : {start}|{bits}@1{sign} ({step},{offset}) [{low}|{high}]")?;
        write!(f, " \"{}\" ", Ascii(unit))?;
        if self.receivers.is_empty() {
            return f.write_str("Vector__XXX");
        }
        f.write_str(&self.receivers.join(","))
    }
}

/// Text converted to the ASCII of DBC files.
struct Ascii<'t>(&'t str);

impl fmt::Display for Ascii<'_> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        use fmt::Write;
        for letter in self.0.chars() {
            match letter {
                '·' => {}
                '"' => f.write_char('\'')?,
                'µ' => f.write_char('u')?,
                '±' => f.write_str("+/-")?,
                ' '..='~' => f.write_char(letter)?,
                _ => f.write_char('?')?,
            }
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn signal_line_follows_the_format() {
        let field = Field {
            name: "elbow_torque".into(),
            start: 48,
            bits: 16,
            number: Number::Signed,
            step: 0.000_125,
            unit: "N·m",
            range: [-4.0, 4.0],
            receivers: vec!["master".into()],
            ..Field::default()
        };
        let line = " SG_ elbow_torque : 48|16@1- (0.000125,0) [-4|4] \"Nm\" master";
        assert_eq!(field.to_string(), line);
    }

    #[test]
    fn output_is_ascii() {
        let text = Ascii("±15 V \"N·m\" µ →\n").to_string();
        assert_eq!(text, "+/-15 V 'Nm' u ??");
    }
}
