//! EXR files of any kind, made byte by byte: parts, windows, subsampled channels and deep data.

/// A part; its value in a channel at a stored column and row is that of `value`.
pub struct Made {
    pub name: &'static str,
    pub deep: bool,
    /// Names, and how many columns and rows have one sample.
    pub channels: Vec<(&'static str, usize)>,
    /// Left, top, width and height of the stored pixels.
    pub data: [i32; 4],
    /// Of the picture.
    pub display: [i32; 4],
    /// The compression's number; whatever it is, lines are stored as they are.
    pub compression: u8,
}

impl Made {
    /// A whole flat part with these channels.
    pub fn new(name: &'static str, channels: &[&'static str]) -> Self {
        let channels = channels.iter().map(|name| (*name, 1)).collect();
        let window = [0, 0, 4, 2];
        Self { name, deep: false, channels, data: window, display: window, compression: 0 }
    }
}

/// The value that is stored: of the channel, counted as listed, at a column and row of the stored pixels.
pub fn value(channel: usize, x: usize, y: usize) -> f32 {
    (channel + 1) as f32 * 100.0 + (y * 10 + x) as f32
}

/// The bytes of a file with these parts.
pub fn made(parts: &[Made]) -> Vec<u8> {
    let several = parts.len() > 1;
    let deep = parts.iter().any(|part| part.deep);
    let flags = (u8::from(deep) * 0x08) | (u8::from(several) * 0x10);
    let mut bytes = vec![0x76, 0x2f, 0x31, 0x01, 2, flags, 0, 0];
    for part in parts {
        attribute(&mut bytes, "channels", "chlist", &channels(part));
        attribute(&mut bytes, "compression", "compression", &[part.compression]);
        attribute(&mut bytes, "dataWindow", "box2i", &window(part.data));
        attribute(&mut bytes, "displayWindow", "box2i", &window(part.display));
        attribute(&mut bytes, "lineOrder", "lineOrder", &[0]);
        attribute(&mut bytes, "pixelAspectRatio", "float", &1f32.to_le_bytes());
        attribute(&mut bytes, "screenWindowCenter", "v2f", &[0; 8]);
        attribute(&mut bytes, "screenWindowWidth", "float", &1f32.to_le_bytes());
        if several || deep {
            let kind = if part.deep { "deepscanline" } else { "scanlineimage" };
            attribute(&mut bytes, "name", "string", part.name.as_bytes());
            attribute(&mut bytes, "type", "string", kind.as_bytes());
            attribute(&mut bytes, "chunkCount", "int", &part.data[3].to_le_bytes());
        }
        if part.deep {
            attribute(&mut bytes, "version", "int", &1i32.to_le_bytes());
            attribute(&mut bytes, "maxSamplesPerPixel", "int", &1i32.to_le_bytes());
        }
        bytes.push(0);
    }
    if several {
        bytes.push(0);
    }
    let rows: i32 = parts.iter().map(|part| part.data[3]).sum();
    bytes.resize(bytes.len() + 8 * rows as usize, 0);
    for (number, part) in parts.iter().enumerate() {
        let [_, top, width, height] = part.data;
        for y in 0..height as usize {
            if several {
                bytes.extend_from_slice(&(number as i32).to_le_bytes());
            }
            bytes.extend_from_slice(&(top + y as i32).to_le_bytes());
            if part.deep {
                // No pixel has a sample: a table of zeros alone.
                let table = vec![0; 4 * width as usize];
                for size in [table.len() as u64, 0, 0] {
                    bytes.extend_from_slice(&size.to_le_bytes());
                }
                bytes.extend_from_slice(&table);
                continue;
            }
            let mut line = Vec::new();
            for (channel, (_, factor)) in part.channels.iter().enumerate() {
                for x in (0..width as usize).step_by(*factor).filter(|_| y % factor == 0) {
                    line.extend_from_slice(&value(channel, x, y).to_le_bytes());
                }
            }
            bytes.extend_from_slice(&(line.len() as i32).to_le_bytes());
            bytes.extend_from_slice(&line);
        }
    }
    bytes
}

fn attribute(bytes: &mut Vec<u8>, name: &str, kind: &str, value: &[u8]) {
    for text in [name, kind] {
        bytes.extend_from_slice(text.as_bytes());
        bytes.push(0);
    }
    bytes.extend_from_slice(&(value.len() as i32).to_le_bytes());
    bytes.extend_from_slice(value);
}

fn window([left, top, width, height]: [i32; 4]) -> Vec<u8> {
    [left, top, left + width - 1, top + height - 1].map(i32::to_le_bytes).concat()
}

fn channels(part: &Made) -> Vec<u8> {
    let mut list = Vec::new();
    for (name, factor) in &part.channels {
        list.extend_from_slice(name.as_bytes());
        list.push(0);
        list.extend_from_slice(&2i32.to_le_bytes());
        list.extend_from_slice(&[0; 4]);
        list.extend_from_slice(&[(*factor as i32).to_le_bytes(); 2].concat());
    }
    list.push(0);
    list
}
