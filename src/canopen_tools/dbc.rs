//! A network as a DBC file, which can-utils' neighbours (cantools, SavvyCAN, CANdb++) read.
//!
//! Only the format; what is in it is said by [`messages`]. Plain ASCII, as tools guess differently at
//! anything else: `Nm` is written for N·m. No multiplexing: an SDO frame could only be told by its
//! command if every command were known, and segments carry bytes where others carry the object.

pub mod messages;

use std::fmt;

/// A whole file.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Database {
    /// Those who send and take, and what they are.
    pub nodes: Vec<(String, String)>,
    /// What they say.
    pub messages: Vec<Message>,
}

/// One frame.
#[derive(Clone, Debug, PartialEq)]
pub struct Message {
    /// Its identifier.
    pub id: u32,
    /// How it is framed.
    pub format: Format,
    /// Its name.
    pub name: String,
    /// How long it is.
    pub bytes: usize,
    /// Who sends it.
    pub sender: String,
    /// What there is to say of it.
    pub comment: String,
    /// The time from one to the next, in ms, if it is sent by a clock.
    pub cycle_ms: Option<u32>,
    /// What is in it.
    pub fields: Vec<Field>,
}

/// How a frame is framed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Format {
    /// Classical CAN with 11 bits.
    #[default]
    Standard,
    /// CAN FD with 29 bits.
    ExtendedFd,
}

/// How bits are read.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Number {
    /// Without a sign.
    #[default]
    Unsigned,
    /// With one.
    Signed,
    /// A double of IEEE 754, 64 bits.
    Double,
}

/// One signal.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Field {
    /// Its name.
    pub name: String,
    /// Its lowest bit, little-endian.
    pub start: u16,
    /// How many bits it has.
    pub bits: u16,
    /// How they are read.
    pub number: Number,
    /// The physical value of one; zero stands for one.
    pub step: f64,
    /// The physical value of raw zero.
    pub offset: f64,
    /// Between which values it stays; equal where that is not known.
    pub range: [f64; 2],
    /// Its unit.
    pub unit: &'static str,
    /// Who takes it.
    pub receivers: Vec<String>,
    /// Values with names.
    pub values: Vec<(i64, &'static str)>,
    /// What there is to say of it.
    pub comment: String,
}

/// Bit 31 of an identifier in a DBC file: it has 29 bits.
const EXTENDED: u32 = 1 << 31;

impl Message {
    const fn id(&self) -> u32 {
        match self.format {
            Format::Standard => self.id,
            Format::ExtendedFd => self.id | EXTENDED,
        }
    }

    /// What `VFrameFormat` calls it: a place in its list.
    const fn frame_format(&self) -> u8 {
        match self.format {
            Format::Standard => 0,
            Format::ExtendedFd => 15,
        }
    }
}

/// `reserved` at all places but those of [`Message::frame_format`] and their neighbours.
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
        let mut lead = "";
        for format in FRAME_FORMATS {
            write!(f, "{lead}\"{format}\"")?;
            lead = ",";
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
                    .try_for_each(|(value, words)| write!(f, " {value} \"{}\"", Ascii(words)))?;
                f.write_str(" ;\n")?;
            }
            for field in message.fields.iter().filter(|field| field.number == Number::Double) {
                writeln!(f, "SIG_VALTYPE_ {id} {} : 2;", field.name)?;
            }
        }
        Ok(())
    }
}

/// ` SG_ elbow_torque : 48|16@1- (0.0001307,0) [-4.28|4.28] "Nm" master`.
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

/// A text as DBC files take it.
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
    fn a_signal_is_written_as_the_format_has_it() {
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
    fn nothing_but_ascii_is_written() {
        let text = Ascii("±15 V \"N·m\" µ →\n").to_string();
        assert_eq!(text, "+/-15 V 'Nm' u ??");
    }
}
