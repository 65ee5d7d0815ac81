namespace DCloth
{
    public static unsafe partial class Native
    {
        public const int DCLOTH_VERSION_MAJOR = 0;
        public const int DCLOTH_VERSION_MINOR = 2;
        public const int DCLOTH_VERSION_PATCH = 0;
        public const uint DCLOTH_VERSION_NUMBER = 2000;

        public const int DCLOTH_ALIGNMENT = 64;
        public const int DCLOTH_MAX_TICKS = 2;

        public const int DCLOTH_OK = 0;
        public const int DCLOTH_ERROR_ARGUMENT = 1;
        public const int DCLOTH_ERROR_ALIGNMENT = 2;
        public const int DCLOTH_ERROR_MEMORY = 3;
        public const int DCLOTH_ERROR_FORMAT = 4;
        public const int DCLOTH_ERROR_VERSION = 5;
        public const int DCLOTH_ERROR_SEMANTICS = 6;
        public const int DCLOTH_ERROR_POSE = 7;
        public const int DCLOTH_ERROR_JOINTS = 8;
        public const int DCLOTH_ERROR_MODEL = 9;

        public const uint DCLOTH_STAGES_STATIC = 1;
        public const uint DCLOTH_STAGES_SKELETON = 3;
        public const uint DCLOTH_STAGES_MESH = 7;

        public const uint DCLOTH_AXIS_X = 0;
        public const uint DCLOTH_AXIS_MINUS_X = 1;
        public const uint DCLOTH_AXIS_Y = 2;
        public const uint DCLOTH_AXIS_MINUS_Y = 3;
        public const uint DCLOTH_AXIS_Z = 4;
        public const uint DCLOTH_AXIS_MINUS_Z = 5;
        public const int DCLOTH_JOINT_TOP = -1;
        public const int DCLOTH_JOINT_UNKNOWN = -2;
        public const uint DCLOTH_JOINT_FRAMES_CONVERTED = 0;
        public const uint DCLOTH_JOINT_FRAMES_KEPT = 1;

        public const uint DCLOTH_FRAME_PIPELINED = 1;
        public const uint DCLOTH_FRAME_JUMPED = 2;
        public const uint DCLOTH_FRAME_HOLD = 8;
        public const uint DCLOTH_FRAME_FREEZE_IDLE = 16;

        public const uint DCLOTH_FORMAT_FLOAT32 = 0;
        public const uint DCLOTH_FORMAT_FLOAT16 = 1;
        public const uint DCLOTH_OUTPUT_OUTSIDE_BODY = 1;
        public const uint DCLOTH_OUTPUT_COARSE = 2;
        public const uint DCLOTH_OUTPUT_TEXTURED = 4;

        public const int DCLOTH_STEP_POSE = 0;
        public const int DCLOTH_STEP_STATIC = 1;
        public const int DCLOTH_STEP_SKELETON = 2;
        public const int DCLOTH_STEP_MESH = 3;
        public const int DCLOTH_STEP_DISPLACEMENT = 4;
        public const int DCLOTH_STEP_SKINNING = 5;
        public const int DCLOTH_STEP_NORMALS = 6;
        public const int DCLOTH_STEP_PENETRATION = 7;
        public const int DCLOTH_STEP_COUNT = 8;
        public const int DCLOTH_TIMER_STEPS = 8;

        public const uint DCLOTH_RESTORE_OTHER_MODEL = 1;

        public const uint DCLOTH_LEVEL_FROZEN = 0;
        public const uint DCLOTH_LEVEL_STATIC = 1;
        public const uint DCLOTH_LEVEL_SKELETON = 2;
        public const uint DCLOTH_LEVEL_MESH = 4;
        public const int DCLOTH_LEVEL_COUNT = 5;
        public const int DCLOTH_SCENE_LEVELS = 5;
        public const uint DCLOTH_DRAW_NONE = 0;
        public const uint DCLOTH_DRAW_COARSE = 1;
        public const uint DCLOTH_DRAW_POSITIONS = 2;
        public const uint DCLOTH_DRAW_FULL = 3;
        public const uint DCLOTH_DRAW_PLAIN = 4;
        public const int DCLOTH_DRAW_COUNT = 5;

        public const int DCLOTH_FIT_ROLES = 32;
        public const int DCLOTH_ROLE_NONE = 0;
        public const int DCLOTH_ROLE_HIPS = 1;
        public const int DCLOTH_ROLE_SPINE = 2;
        public const int DCLOTH_ROLE_CHEST = 3;
        public const int DCLOTH_ROLE_UPPER_CHEST = 4;
        public const int DCLOTH_ROLE_NECK = 5;
        public const int DCLOTH_ROLE_HEAD = 6;
        public const int DCLOTH_ROLE_LEFT_SHOULDER = 7;
        public const int DCLOTH_ROLE_LEFT_UPPER_ARM = 8;
        public const int DCLOTH_ROLE_LEFT_LOWER_ARM = 9;
        public const int DCLOTH_ROLE_LEFT_HAND = 10;
        public const int DCLOTH_ROLE_RIGHT_SHOULDER = 11;
        public const int DCLOTH_ROLE_RIGHT_UPPER_ARM = 12;
        public const int DCLOTH_ROLE_RIGHT_LOWER_ARM = 13;
        public const int DCLOTH_ROLE_RIGHT_HAND = 14;
        public const int DCLOTH_ROLE_LEFT_UPPER_LEG = 15;
        public const int DCLOTH_ROLE_LEFT_LOWER_LEG = 16;
        public const int DCLOTH_ROLE_LEFT_FOOT = 17;
        public const int DCLOTH_ROLE_LEFT_TOES = 18;
        public const int DCLOTH_ROLE_RIGHT_UPPER_LEG = 19;
        public const int DCLOTH_ROLE_RIGHT_LOWER_LEG = 20;
        public const int DCLOTH_ROLE_RIGHT_FOOT = 21;
        public const int DCLOTH_ROLE_RIGHT_TOES = 22;
        public const int DCLOTH_FIT_STAND_IN = 1;
        public const int DCLOTH_FIT_PROPORTIONS = 2;
        public const int DCLOTH_FIT_STANCE = 4;
        public const int DCLOTH_FIT_GIRTH = 8;
        public const int DCLOTH_FIT_GAP = 16;
        public const int DCLOTH_FIT_PENETRATION = 32;
        public const int DCLOTH_FIT_FACING = 64;
    }
}
