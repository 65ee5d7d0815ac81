use std::ptr::null_mut;

use crate::error::Error;
use crate::ffi::*;
use crate::model::Model;

/// Where the vertices of a frame are written: slices of the host, as long as the garment has vertices. They are also
/// read, so do not give memory of a GPU that is slow to read.
///
/// ```
/// let (mut positions, mut normals) = (vec![[0.0; 3]; 8170], vec![[0.0; 3]; 8170]);
/// let output = dcloth::Output::new(&mut positions).normals(&mut normals).outside_body(true);
/// ```
#[derive(Debug)]
#[must_use]
pub struct Output<'a> {
    positions: Positions<'a>,
    normals: Option<&'a mut [[f32; 3]]>,
    tangents: Option<Tangents<'a>>,
    bounds: Option<&'a mut [[f32; 3]; 2]>,
    outside_body: bool,
    textured: bool,
}

#[derive(Debug)]
struct Tangents<'a> {
    tangents: &'a mut [[f32; 4]],
    coordinates: &'a [[f32; 2]],
}

#[derive(Debug)]
enum Positions<'a> {
    Packed(&'a mut [[f32; 3]]),
    Interleaved { buffer: &'a mut [f32], floats: usize, position: usize, normal: Option<usize> },
}

impl<'a> Output<'a> {
    /// Writes positions, one after another: world, in the host's unit.
    pub fn new(positions: &'a mut [[f32; 3]]) -> Self {
        Self::of(Positions::Packed(positions))
    }

    /// Writes into a vertex buffer of floats, in which each vertex takes `floats_per_vertex` of them. `position` and
    /// `normal` are the places of these attributes in a vertex, counted in floats. Floats between are left as they are.
    ///
    /// ```
    /// # std::env::set_current_dir(std::env::var("DCLOTH_RUST_DATA")?)?;
    /// # let model = dcloth::Model::read("skirt.dcloth")?;
    /// # let mut cloth = dcloth::Cloth::new(&model)?;
    /// # let bind: Vec<[f32; 16]> = (0..model.joint_count()).map(|j| model.joint_bind(j)).collect::<Result<_, _>>()?;
    /// # let (pose, frame) = (dcloth::Pose::rows(&bind), dcloth::Frame::new(1.0 / 60.0));
    /// let mut buffer = vec![0.0; 8 * model.vertex_count()]; // position, normal, u, v
    /// cloth.update(&pose, &frame, dcloth::Output::interleaved(&mut buffer, 8, 0, Some(3)))?;
    /// # assert!(buffer[0] != 0.0 && buffer[3] != 0.0 && buffer[6] == 0.0);
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn interleaved(
        buffer: &'a mut [f32],
        floats_per_vertex: usize,
        position: usize,
        normal: Option<usize>,
    ) -> Self {
        Self::of(Positions::Interleaved { buffer, floats: floats_per_vertex, position, normal })
    }

    fn of(positions: Positions<'a>) -> Self {
        Self { positions, normals: None, tangents: None, bounds: None, outside_body: false, textured: false }
    }

    /// Writes normals too: unit length, outward.
    pub fn normals(mut self, normals: &'a mut [[f32; 3]]) -> Self {
        self.normals = Some(normals);
        self
    }

    /// Writes tangents too: a unit vector along growing u, and w = 1 or -1, where the bitangent is w cross(normal,
    /// tangent). They need normals, and the texture coordinates u, v of each vertex.
    pub fn tangents(mut self, tangents: &'a mut [[f32; 4]], texture_coordinates: &'a [[f32; 2]]) -> Self {
        self.tangents = Some(Tangents { tangents, coordinates: texture_coordinates });
        self
    }

    /// Writes the corners of the box around all vertices: the smallest x, y, z, then the largest.
    pub fn bounds(mut self, bounds: &'a mut [[f32; 3]; 2]) -> Self {
        self.bounds = Some(bounds);
        self
    }

    /// Pushes vertices out of the body. It does nothing where the model holds no body
    /// ([`Model::body_vertex_count`](crate::Model::body_vertex_count)).
    pub fn outside_body(mut self, on: bool) -> Self {
        self.outside_body = on;
        self
    }

    /// Writes the vertices of [`Texture`](crate::Texture): all slices are as long as its coordinates.
    pub fn textured(mut self, on: bool) -> Self {
        self.textured = on;
        self
    }

    /// The description that the engine reads. Its pointers are good while `self` is borrowed.
    pub(crate) fn raw(&mut self, model: &Model) -> Result<dcloth_output, Error> {
        let vertex_count = match model.texture() {
            Some(texture) if self.textured => texture.coordinates.len(),
            None if self.textured => {
                return Err(Error::argument("texture coordinates of the model", "none", "some, for a textured output"));
            }
            _ => model.vertex_count(),
        };
        let same = |what: &str, found: usize| {
            let allowed = format_args!("{vertex_count}, one for each vertex");
            if found == vertex_count { Ok(()) } else { Err(Error::argument(what, found, allowed)) }
        };
        let mut output = dcloth_output::new();
        output.vertex_count = vertex_count as u32;
        output.flags = if self.outside_body { DCLOTH_OUTPUT_OUTSIDE_BODY } else { 0 }
            | if self.textured { DCLOTH_OUTPUT_TEXTURED } else { 0 };
        match &mut self.positions {
            Positions::Packed(positions) => {
                same("positions", positions.len())?;
                output.positions = positions.as_mut_ptr().cast();
                output.position_stride_bytes = 12;
            }
            Positions::Interleaved { buffer, floats, position, normal } => {
                let places = [Some(*position), *normal];
                for place in places.into_iter().flatten() {
                    if place.checked_add(3).is_none_or(|end| end > *floats) {
                        let allowed = format_args!("3 floats that end within the {floats} of a vertex");
                        return Err(Error::argument("place of an attribute", place, allowed));
                    }
                }
                if normal.is_some_and(|normal| normal.abs_diff(*position) < 3) {
                    return Err(Error::argument("place of the normal", "one over the position", "3 floats of its own"));
                }
                if floats.checked_mul(vertex_count) != Some(buffer.len()) {
                    let allowed = format_args!("{floats} for each of {vertex_count} vertices");
                    return Err(Error::argument("floats of the buffer", buffer.len(), allowed));
                }
                let stride = u32::try_from(floats.saturating_mul(4))
                    .map_err(|_| Error::argument("floats_per_vertex", *floats, "less than 2^30"))?;
                let first = buffer.as_mut_ptr();
                output.positions = first.wrapping_add(*position).cast();
                output.position_stride_bytes = stride;
                if let Some(normal) = *normal {
                    output.normals = first.wrapping_add(normal).cast();
                    output.normal_stride_bytes = stride;
                }
            }
        }
        if let Some(normals) = &mut self.normals {
            same("normals", normals.len())?;
            output.normals = normals.as_mut_ptr().cast();
            output.normal_stride_bytes = 12;
        }
        if let Some(Tangents { tangents, coordinates }) = &mut self.tangents {
            same("tangents", tangents.len())?;
            same("texture_coordinates", coordinates.len())?;
            output.tangents = tangents.as_mut_ptr().cast();
            output.tangent_stride_bytes = 16;
            output.texture_coordinates = coordinates.as_ptr().cast();
            output.texture_stride_bytes = 8;
        }
        output.bounds = self.bounds.as_mut().map_or(null_mut(), |bounds| bounds.as_mut_ptr().cast());
        Ok(output)
    }
}
