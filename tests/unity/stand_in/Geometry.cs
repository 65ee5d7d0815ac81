// Vectors, matrices and transforms as Unity defines them: left-handed, columns of a matrix contiguous; see Objects.cs.
using System;
using System.Collections.Generic;
using System.Linq;
using System.Runtime.InteropServices;

namespace UnityEngine
{
    [StructLayout(LayoutKind.Sequential)]
    public struct Vector2
    {
        public float x, y;

        public Vector2(float x, float y)
        {
            this.x = x;
            this.y = y;
        }
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Vector3
    {
        public float x, y, z;

        public Vector3(float x, float y, float z)
        {
            this.x = x;
            this.y = y;
            this.z = z;
        }

        public static Vector3 one => new Vector3(1, 1, 1);

        public static Vector3 operator +(Vector3 a, Vector3 b) => new Vector3(a.x + b.x, a.y + b.y, a.z + b.z);

        public static Vector3 operator -(Vector3 a, Vector3 b) => new Vector3(a.x - b.x, a.y - b.y, a.z - b.z);

        public static Vector3 operator *(float s, Vector3 a) => new Vector3(s * a.x, s * a.y, s * a.z);

        public static Vector3 Lerp(Vector3 a, Vector3 b, float t) => a + Mathf.Clamp01(t) * (b - a);

        public static Vector3 Cross(Vector3 a, Vector3 b) =>
            new Vector3(a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x);

        public static Vector3 Normalize(Vector3 a) =>
            1 / (float)Math.Sqrt(a.x * a.x + a.y * a.y + a.z * a.z) * a;
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Vector4
    {
        public float x, y, z, w;

        public float magnitude => (float)Math.Sqrt(x * x + y * y + z * z + w * w);
    }

    public static class Mathf
    {
        public static int Min(int a, int b) => a < b ? a : b;

        public static float Clamp01(float x) => x < 0 ? 0 : x > 1 ? 1 : x;
    }

    public struct Bounds
    {
        public Vector3 min, max;

        public void SetMinMax(Vector3 least, Vector3 greatest)
        {
            min = least;
            max = greatest;
        }
    }

    /// <summary>Kept as the matrix it stands for.</summary>
    public struct Quaternion
    {
        internal Vector3 right, up, forward;

        public static Quaternion identity =>
            new Quaternion { right = new Vector3(1, 0, 0), up = new Vector3(0, 1, 0), forward = new Vector3(0, 0, 1) };

        /// <summary>About +Y alone.</summary>
        public static Quaternion Euler(float x, float y, float z)
        {
            if (x != 0 || z != 0) throw new NotSupportedException();
            double yaw = y * Math.PI / 180;
            return LookRotation(new Vector3((float)Math.Sin(yaw), 0, (float)Math.Cos(yaw)), new Vector3(0, 1, 0));
        }

        public static Quaternion LookRotation(Vector3 forward, Vector3 upwards)
        {
            Vector3 z = Vector3.Normalize(forward), x = Vector3.Normalize(Vector3.Cross(upwards, z));
            return new Quaternion { right = x, up = Vector3.Cross(z, x), forward = z };
        }

        /// <summary>Not spherical: straight, then made a rotation again. Good for small angles.</summary>
        public static Quaternion Slerp(Quaternion a, Quaternion b, float t)
        {
            return LookRotation(Vector3.Lerp(a.forward, b.forward, t), Vector3.Lerp(a.up, b.up, t));
        }
    }

    [StructLayout(LayoutKind.Sequential)]
    public struct Matrix4x4
    {
        public float m00, m10, m20, m30, m01, m11, m21, m31, m02, m12, m22, m32, m03, m13, m23, m33;

        internal static Matrix4x4 Of(Vector3 x, Vector3 y, Vector3 z, Vector3 t)
        {
            return new Matrix4x4 { m00 = x.x, m10 = x.y, m20 = x.z, m01 = y.x, m11 = y.y, m21 = y.z,
                                   m02 = z.x, m12 = z.y, m22 = z.z, m03 = t.x, m13 = t.y, m23 = t.z, m33 = 1 };
        }

        internal Vector3 Column(int c) => c == 0 ? new Vector3(m00, m10, m20) : c == 1 ? new Vector3(m01, m11, m21)
            : c == 2 ? new Vector3(m02, m12, m22) : new Vector3(m03, m13, m23);

        public Vector4 GetColumn(int index)
        {
            Vector3 column = Column(index);
            return new Vector4 { x = column.x, y = column.y, z = column.z, w = index == 3 ? m33 : 0 };
        }

        public Vector3 MultiplyVector(Vector3 v) => v.x * Column(0) + v.y * Column(1) + v.z * Column(2);

        public Vector3 MultiplyPoint3x4(Vector3 v) => MultiplyVector(v) + Column(3);

        public static Matrix4x4 operator *(Matrix4x4 a, Matrix4x4 b)
        {
            return Of(a.MultiplyVector(b.Column(0)), a.MultiplyVector(b.Column(1)), a.MultiplyVector(b.Column(2)),
                      a.MultiplyPoint3x4(b.Column(3)));
        }
    }

    public sealed class Transform : Component
    {
        private readonly List<Transform> children = new List<Transform>();
        private Transform parent;

        public Vector3 localPosition { get; set; }
        public Quaternion localRotation { get; set; } = Quaternion.identity;
        public Vector3 localScale { get; set; } = Vector3.one;

        public Matrix4x4 localToWorldMatrix
        {
            get
            {
                Matrix4x4 local = Matrix4x4.Of(localScale.x * localRotation.right, localScale.y * localRotation.up,
                                               localScale.z * localRotation.forward, localPosition);
                return parent == null ? local : parent.localToWorldMatrix * local;
            }
        }

        /// <summary>Of transforms without scale: the transpose of a rotation.</summary>
        public Matrix4x4 worldToLocalMatrix
        {
            get
            {
                Matrix4x4 m = localToWorldMatrix;
                Matrix4x4 turned = Matrix4x4.Of(new Vector3(m.m00, m.m01, m.m02), new Vector3(m.m10, m.m11, m.m12),
                                                new Vector3(m.m20, m.m21, m.m22), new Vector3(0, 0, 0));
                Vector3 back = turned.MultiplyVector(-1 * m.Column(3));
                return Matrix4x4.Of(turned.Column(0), turned.Column(1), turned.Column(2), back);
            }
        }

        public Vector3 position => localToWorldMatrix.Column(3);

        public Quaternion rotation
        {
            get
            {
                Matrix4x4 m = localToWorldMatrix;
                return new Quaternion { right = m.Column(0), up = m.Column(1), forward = m.Column(2) };
            }
        }

        public new string name => gameObject.name;

        public void SetParent(Transform newParent, bool worldPositionStays)
        {
            if (worldPositionStays) throw new NotSupportedException();
            parent?.children.Remove(this);
            newParent?.children.Add(this);
            parent = newParent;
        }

        internal IEnumerable<Transform> WithChildren()
        {
            return new[] { this }.Concat(children.SelectMany(c => c.WithChildren()));
        }

        public void SetPositionAndRotation(Vector3 newPosition, Quaternion newRotation)
        {
            if (parent != null) throw new NotSupportedException();
            localPosition = newPosition;
            localRotation = newRotation;
        }
    }
}
