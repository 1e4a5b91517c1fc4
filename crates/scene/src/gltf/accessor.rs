//! Typed values from buffers, with every offset validated.

use gltf::json::accessor::{Accessor, ComponentType, IndexComponentType, Type, sparse};
use gltf::json::validation::Checked;
use gltf::json::{Index, Root, buffer};

use super::files::Buffers;
use super::problem::{Problem, missing};

/// Maximum number of elements of one accessor.
pub(super) const MAX_ELEMENTS: usize = 6_000_000;

/// Reads the accessors of a file.
#[derive(Clone, Copy)]
pub(super) struct Accessors<'a> {
    pub(super) root: &'a Root,
    pub(super) buffers: &'a Buffers<'a>,
}

/// Elements in a buffer view.
struct Elements<'a> {
    bytes: &'a [u8],
    stride: usize,
    size: usize,
}

impl Elements<'_> {
    fn get(&self, i: usize) -> &[u8] {
        &self.bytes[i * self.stride..][..self.size]
    }
}

fn component_size(component: ComponentType) -> usize {
    match component {
        ComponentType::I8 | ComponentType::U8 => 1,
        ComponentType::I16 | ComponentType::U16 => 2,
        ComponentType::U32 | ComponentType::F32 => 4,
    }
}

/// One unsigned integer.
fn whole(bytes: &[u8]) -> u32 {
    match *bytes {
        [a] => u32::from(a),
        [a, b] => u32::from(u16::from_le_bytes([a, b])),
        [a, b, c, d] => u32::from_le_bytes([a, b, c, d]),
        _ => u32::MAX,
    }
}

/// One component of a vector: a float, or a fraction.
fn number(bytes: &[u8], component: ComponentType) -> f32 {
    match component {
        ComponentType::I8 => (f32::from(whole(bytes) as i8) / 127.0).max(-1.0),
        ComponentType::I16 => (f32::from(whole(bytes) as i16) / 32_767.0).max(-1.0),
        ComponentType::U8 => whole(bytes) as f32 / 255.0,
        ComponentType::U16 => whole(bytes) as f32 / 65_535.0,
        _ => f32::from_bits(whole(bytes)),
    }
}

impl<'a> Accessors<'a> {
    /// Number of elements of an accessor.
    pub(super) fn count(&self, index: Index<Accessor>) -> Result<usize, Problem> {
        let accessor = self.accessor(index)?;
        usize::try_from(accessor.count.0).ok().filter(|count| *count <= MAX_ELEMENTS).ok_or_else(|| {
            let message =
                format!("accessor {} has {} elements; at most {MAX_ELEMENTS} are supported", index.value(), accessor.count.0);
            Problem::new(message).hint("simplify or split the meshes")
        })
    }

    /// Vectors of floats or, for normalised values (texture coordinates, colours, rotations), of fractions. A vector with
    /// fewer than `N` components is filled up with `fill`, where `least` allows it.
    pub(super) fn vectors<const N: usize>(
        &self,
        index: Index<Accessor>,
        least: usize,
        fill: f32,
        fractions: bool,
    ) -> Result<Vec<[f32; N]>, Problem> {
        let accessor = self.accessor(index)?;
        let (component, kind) = self.kind(accessor, index)?;
        let width = kind.multiplicity();
        let fits = component == ComponentType::F32 || (fractions && accessor.normalized && component != ComponentType::U32);
        let flat = !matches!(kind, Type::Mat2 | Type::Mat3 | Type::Mat4);
        if !fits || !flat || !(least..=N).contains(&width) {
            let message = format!("accessor {} has {kind:?} of {component:?}, which is not valid for its use", index.value());
            return Err(Problem::new(message).hint("export coordinates as 32-bit floats"));
        }
        let size = component_size(component);
        let read = |bytes: &[u8]| {
            let mut vector = [fill; N];
            for (slot, bytes) in vector.iter_mut().zip(bytes.chunks_exact(size)) {
                *slot = number(bytes, component);
            }
            vector
        };
        self.elements(accessor, index, size * width, read)
    }

    /// Corner numbers.
    pub(super) fn indices(&self, index: Index<Accessor>) -> Result<Vec<u32>, Problem> {
        let accessor = self.accessor(index)?;
        let (component, kind) = self.kind(accessor, index)?;
        let unsigned = matches!(component, ComponentType::U8 | ComponentType::U16 | ComponentType::U32);
        if !unsigned || kind != Type::Scalar {
            return Err(Problem::new(format!("accessor {} is not a valid index list", index.value())));
        }
        self.elements(accessor, index, component_size(component), whole)
    }

    fn accessor(&self, index: Index<Accessor>) -> Result<&'a Accessor, Problem> {
        self.root.accessors.get(index.value()).ok_or_else(|| missing("accessor", index.value()))
    }

    fn kind(&self, accessor: &Accessor, index: Index<Accessor>) -> Result<(ComponentType, Type), Problem> {
        match (&accessor.component_type, &accessor.type_) {
            (Checked::Valid(component), Checked::Valid(kind)) => Ok((component.0, *kind)),
            _ => Err(Problem::new(format!("accessor {} has an unknown type", index.value()))),
        }
    }

    fn elements<T: Clone>(
        &self,
        accessor: &Accessor,
        index: Index<Accessor>,
        size: usize,
        read: impl Fn(&[u8]) -> T,
    ) -> Result<Vec<T>, Problem> {
        let count = self.count(index)?;
        let beyond = || Problem::new(format!("accessor {} exceeds its buffer view", index.value()));
        let mut values = match accessor.buffer_view {
            Some(view) => {
                let offset = accessor.byte_offset.unwrap_or_default().0;
                let elements = self.within(view, offset, count, size)?.ok_or_else(beyond)?;
                (0..count).map(|i| read(elements.get(i))).collect()
            }
            None => vec![read(&vec![0; size]); count],
        };
        if let Some(sparse) = &accessor.sparse {
            let replaced = usize::try_from(sparse.count.0).ok().filter(|n| *n <= count).ok_or_else(beyond)?;
            let places = self.places(&sparse.indices, replaced)?.ok_or_else(beyond)?;
            let given = self.within(sparse.values.buffer_view, sparse.values.byte_offset.0, replaced, size)?;
            let given = given.ok_or_else(beyond)?;
            for (i, place) in places.into_iter().enumerate() {
                *values.get_mut(place as usize).ok_or_else(beyond)? = read(given.get(i));
            }
        }
        Ok(values)
    }

    fn places(&self, indices: &sparse::Indices, count: usize) -> Result<Option<Vec<u32>>, Problem> {
        let Checked::Valid(IndexComponentType(component)) = indices.component_type else { return Ok(None) };
        let elements = self.within(indices.buffer_view, indices.byte_offset.0, count, component_size(component))?;
        Ok(elements.map(|elements| (0..count).map(|i| whole(elements.get(i))).collect()))
    }

    /// `count` elements of `size` bytes from `offset` in a buffer view; `None` if they do not fit.
    fn within(&self, view: Index<buffer::View>, offset: u64, count: usize, size: usize) -> Result<Option<Elements<'a>>, Problem> {
        let (bytes, stride) = self.buffers.view(self.root, view)?;
        let stride = stride.unwrap_or(size);
        let needed = count.saturating_sub(1).saturating_mul(stride).saturating_add(if count > 0 { size } else { 0 });
        let bytes = usize::try_from(offset).ok().and_then(|offset| bytes.get(offset..));
        Ok(bytes.filter(|bytes| bytes.len() >= needed && stride >= size).map(|bytes| Elements { bytes, stride, size }))
    }
}
