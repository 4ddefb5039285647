//! Vertices of a mesh in an STL file.

use nalgebra::Point3;

/// Bytes before the first triangle of a binary file, and of each triangle.
const HEADER: usize = 84;
const TRIANGLE: usize = 50;

/// Why bytes are not a mesh.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum StlError {
    /// Neither the binary nor the text form.
    #[error("{bytes} bytes are neither an ASCII STL nor a binary one of {triangles} triangles")]
    NotStl {
        /// Size of the file.
        bytes: usize,
        /// Number of triangles that a binary header says, zero if there is none.
        triangles: u32,
    },
    /// A line of the text form is not a vertex.
    #[error("line {line} is not a vertex of three finite numbers")]
    Vertex {
        /// Line, counted from one.
        line: usize,
    },
    /// A triangle of the binary form has a coordinate that is not finite.
    #[error("triangle {triangle} has a coordinate that is not finite")]
    NotFinite {
        /// Index of the triangle.
        triangle: usize,
    },
    /// The file has no triangles.
    #[error("the mesh has no triangles")]
    Empty,
}

/// Vertices of the triangles in an STL file, binary or ASCII, three for each, in the file's unit.
///
/// Normals are passed over. A file is binary if its size fits the count in its header, whatever it
/// starts with: many binary files start with `solid` too.
///
/// # Errors
/// [`StlError`] lists them: the bytes are no STL, a number is missing or not finite, no triangle.
pub fn read_stl(bytes: &[u8]) -> Result<Vec<Point3<f64>>, StlError> {
    let triangles =
        bytes.get(80..HEADER).and_then(|count| count.try_into().ok()).map_or(0, u32::from_le_bytes);
    let size = usize::try_from(triangles)
        .ok()
        .and_then(|count| count.checked_mul(TRIANGLE)?.checked_add(HEADER));
    let text =
        std::str::from_utf8(bytes).ok().filter(|text| text.trim_start().starts_with("solid"));
    let vertices = match (size == Some(bytes.len()), text) {
        (true, _) => read_binary(bytes.get(HEADER..).unwrap_or_default())?,
        (false, Some(text)) => read_text(text)?,
        (false, None) => return Err(StlError::NotStl { bytes: bytes.len(), triangles }),
    };
    if vertices.is_empty() { Err(StlError::Empty) } else { Ok(vertices) }
}

fn read_binary(bytes: &[u8]) -> Result<Vec<Point3<f64>>, StlError> {
    let mut vertices = Vec::with_capacity(bytes.len() / TRIANGLE * 3);
    for (triangle, record) in bytes.chunks_exact(TRIANGLE).enumerate() {
        // After the normal of twelve bytes: three vertices of three floats.
        for vertex in record.get(12..48).unwrap_or_default().chunks_exact(12) {
            let mut numbers = vertex
                .chunks_exact(4)
                .filter_map(|word| word.try_into().ok().map(f32::from_le_bytes))
                .map(f64::from);
            let mut next = || numbers.next().filter(|number| number.is_finite());
            match (next(), next(), next()) {
                (Some(x), Some(y), Some(z)) => vertices.push(Point3::new(x, y, z)),
                _ => return Err(StlError::NotFinite { triangle }),
            }
        }
    }
    Ok(vertices)
}

fn read_text(text: &str) -> Result<Vec<Point3<f64>>, StlError> {
    let mut vertices = Vec::new();
    for (index, line) in text.lines().enumerate() {
        let mut words = line.split_whitespace();
        if words.next() != Some("vertex") {
            continue;
        }
        let mut next = || words.next()?.parse().ok().filter(|number: &f64| number.is_finite());
        match (next(), next(), next(), words.next()) {
            (Some(x), Some(y), Some(z), None) => vertices.push(Point3::new(x, y, z)),
            _ => return Err(StlError::Vertex { line: index + 1 }),
        }
    }
    Ok(vertices)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn binary(header: &[u8], triangles: &[[[f32; 3]; 3]]) -> Vec<u8> {
        let mut bytes = header.to_vec();
        bytes.resize(80, b' ');
        bytes.extend(u32::try_from(triangles.len()).expect("few").to_le_bytes());
        for triangle in triangles {
            bytes.extend([0; 12]);
            bytes.extend(triangle.iter().flatten().flat_map(|number| number.to_le_bytes()));
            bytes.extend([0; 2]);
        }
        bytes
    }

    const TRIANGLES: [[[f32; 3]; 3]; 1] = [[[1.0, 0.5, 0.0], [0.0, -2.0, 0.25], [0.0, 0.0, 3.0]]];

    fn expected() -> Vec<Point3<f64>> {
        vec![Point3::new(1.0, 0.5, 0.0), Point3::new(0.0, -2.0, 0.25), Point3::new(0.0, 0.0, 3.0)]
    }

    #[test]
    fn a_binary_file_is_read_even_if_it_starts_with_solid() {
        assert_eq!(read_stl(&binary(b"made by a tool", &TRIANGLES)), Ok(expected()));
        assert_eq!(read_stl(&binary(b"solid part", &TRIANGLES)), Ok(expected()));
    }

    #[test]
    fn a_text_file_is_read() {
        let text = "solid part\n facet normal 0 0 1\n  outer loop\n   vertex 1 5e-1 0\n   \
                    vertex 0 -2 0.25\n vertex 0 0 3\n  endloop\n endfacet\nendsolid part\n";
        assert_eq!(read_stl(text.as_bytes()), Ok(expected()));
    }

    #[test]
    fn broken_files_are_refused() {
        assert_eq!(read_stl(b""), Err(StlError::NotStl { bytes: 0, triangles: 0 }));
        let mut short = binary(b"x", &TRIANGLES);
        short.pop();
        assert_eq!(read_stl(&short), Err(StlError::NotStl { bytes: 133, triangles: 1 }));
        assert_eq!(read_stl(&binary(b"x", &[])), Err(StlError::Empty));
        assert_eq!(read_stl(b"solid x\nendsolid x"), Err(StlError::Empty));
        for line in ["vertex 1 2", "vertex 1 2 3 4", "vertex 1 2 x", "vertex 1 2 inf"] {
            let text = format!("solid x\n{line}\n");
            assert_eq!(read_stl(text.as_bytes()), Err(StlError::Vertex { line: 2 }), "{line}");
        }
        let mut nan = TRIANGLES;
        nan[0][1][2] = f32::NAN;
        assert_eq!(read_stl(&binary(b"x", &nan)), Err(StlError::NotFinite { triangle: 0 }));
    }
}
